"""Array types: real signals and complex phasors differ, so that mixing them is a type error."""

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

CountArray: TypeAlias = npt.NDArray[np.int16]
"""Raw converter counts."""

SampleArray: TypeAlias = npt.NDArray[np.float32]
"""Samples in engineering units as they travel through the house."""

RawArray: TypeAlias = CountArray | SampleArray
"""What a device delivers: counts of its converter, or engineering units it has made itself."""

FloatArray: TypeAlias = npt.NDArray[np.float64]
"""Real numbers that are calculated with."""

ComplexArray: TypeAlias = npt.NDArray[np.complex128]
"""Phasors and transforms."""


TimeArray: TypeAlias = npt.NDArray[np.int64]
"""Nanoseconds since 1970, UTC."""
