"""NumPy array types of samples, real numbers, complex phasors and times."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

CountArray: TypeAlias = npt.NDArray[np.int16]
"""Raw counts of an analog-to-digital converter."""

SampleArray: TypeAlias = npt.NDArray[np.float32]
"""Samples in engineering units, as passed between components."""

RawArray: TypeAlias = CountArray | SampleArray
"""Samples as a device delivers them: converter counts, or values in engineering units."""

FloatArray: TypeAlias = npt.NDArray[np.float64]
"""Real numbers in double precision, for calculations."""

ComplexArray: TypeAlias = npt.NDArray[np.complex128]
"""Complex phasors and spectra."""

BoolArray: TypeAlias = npt.NDArray[np.bool_]
"""Masks."""
IntArray: TypeAlias = npt.NDArray[np.int64]
"""Indices and counts."""

TimeArray: TypeAlias = npt.NDArray[np.int64]
"""Times in nanoseconds since 1970, UTC."""
