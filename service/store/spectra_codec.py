"""Amplitudes as two bytes each, of equal relative accuracy; and the checksum of a spectrum."""

import hashlib
import math

import numpy as np

from core.arrays import FloatArray
from service.store.spectra_port import N_CHANNELS

LOWEST_UM, HIGHEST_UM = 1e-6, 1e5
"""What can be told apart: smaller amplitudes read zero, larger ones this."""

N_STEPS = 65_533
STEP = math.log(HIGHEST_UM / LOWEST_UM) / N_STEPS
"""Of the logarithm: amplitudes come back within 0.02 %, which no transducer is worth."""

ZERO, UNUSABLE = 0, 65_535

CHECKSUM_BYTES = 8


def encode(amplitude_um_pk: FloatArray) -> bytes:
    """(N_CHANNELS, n_lines) amplitudes, NaN where a channel is not usable."""
    usable = np.nan_to_num(amplitude_um_pk, nan=LOWEST_UM)
    steps = np.log(np.clip(usable, LOWEST_UM, HIGHEST_UM) / LOWEST_UM) / STEP
    codes = 1 + np.round(steps).astype(np.int64)
    codes[usable < LOWEST_UM] = ZERO
    codes[np.isnan(amplitude_um_pk)] = UNUSABLE
    return codes.astype("<u2").tobytes()


def decode(amplitudes: bytes) -> FloatArray:
    """Invert `encode`."""
    codes = np.frombuffer(amplitudes, dtype="<u2").reshape(N_CHANNELS, -1)
    found: FloatArray = LOWEST_UM * np.exp(STEP * (codes.astype(np.float64) - 1.0))
    found[codes == ZERO] = 0.0
    found[codes == UNUSABLE] = np.nan
    return found


def checksum(facts: tuple[object, ...], amplitudes: bytes) -> bytes:
    """Of all that is kept of a spectrum.

    Parameters
    ----------
    facts
        Integers, floats, texts and None, just as they come back from the database.
    """
    digest = hashlib.blake2b(repr(facts).encode(), digest_size=CHECKSUM_BYTES)
    digest.update(amplitudes)
    return digest.digest()
