"""Noise of accelerometers: white, rising as 1/f below a corner, integrated where velocity is read.

The noise is followed down to `FLOOR_HZ`, below which a double high-pass takes it away: 1/f noise
integrated to velocity has no finite power towards 0 Hz, and no charge amplifier passes it either.
"""

import math
from collections.abc import Iterator

import numpy as np

from core.arrays import FloatArray
from core.units import STANDARD_GRAVITY_M_S2

FLOOR_HZ = 0.1
PINK_BAND_HZ = (0.02, 60.0)
"""Where 1/f noise is 1/f: to 2 % in power, and to 0.3 % between 0.1 and 25 Hz."""
POLES_PER_DECADE = 3


class AccelerometerNoise:
    """Endless noise of some channels.

    Parameters
    ----------
    integrated
        (n_channels,) whether the channel reads velocity in mm/s; else acceleration in m/s².
    density_g_per_sqrt_hz
        One-sided, above the corner.
    """

    def __init__(
        self,
        random: np.random.Generator,
        integrated: tuple[bool, ...],
        density_g_per_sqrt_hz: float,
        corner_hz: float,
        rate_hz: float,
    ) -> None:
        self._random = random
        self._n_channels = len(integrated)
        # a one-sided density of 1 over the band up to half the rate is a variance of rate / 2
        self._white = density_g_per_sqrt_hz * STANDARD_GRAVITY_M_S2 * math.sqrt(rate_hz / 2.0)
        self._pink = _pink(corner_hz, rate_hz)
        self._floors = [_floor(velocity, rate_hz) for velocity in integrated]
        self._pink_state = np.zeros((len(self._pink), len(integrated), 2))
        self._floor_states = [np.zeros((len(floor), 2)) for floor in self._floors]

    def advance(self, n_samples: int) -> FloatArray:
        """Give the next noise, (n_channels, n_samples)."""
        import scipy.signal  # slow to load, and not needed to begin

        white, pink = self._white * self._random.standard_normal((2, self._n_channels, n_samples))
        pink, self._pink_state = scipy.signal.sosfilt(self._pink, pink, zi=self._pink_state)
        return np.array(list(self._floored(white + pink))).reshape(white.shape)

    def _floored(self, noise: FloatArray) -> Iterator[FloatArray]:
        import scipy.signal  # slow to load, and not needed to begin

        for channel, floor in enumerate(self._floors):
            row, self._floor_states[channel] = scipy.signal.sosfilt(
                floor, noise[channel], zi=self._floor_states[channel]
            )
            yield row


def _floor(integrates: bool, rate_hz: float) -> FloatArray:
    """High-pass of order 2, from m/s² to m/s² or, with one zero less, to mm/s."""
    import scipy.signal  # slow to load, and not needed to begin

    floor_rad_s = 2.0 * math.pi * FLOOR_HZ
    numerator = [1e3, 0.0] if integrates else [1.0, 0.0, 0.0]
    denominator = [1.0, math.sqrt(2.0) * floor_rad_s, floor_rad_s**2]
    return np.atleast_2d(np.hstack(scipy.signal.bilinear(numerator, denominator, rate_hz)))


def _pink(corner_hz: float, rate_hz: float) -> FloatArray:
    """Filter whose power falls as corner / f: poles and zeros take turns (Oustaloup, 1991)."""
    import scipy.signal  # slow to load, and not needed to begin

    low_hz, high_hz = PINK_BAND_HZ
    high_hz = min(high_hz, 0.3 * rate_hz)
    n_poles = math.ceil(POLES_PER_DECADE * math.log10(high_hz / low_hz))
    edges_hz = np.geomspace(low_hz / 4.0, 4.0 * high_hz, 2 * n_poles + 1)
    poles, zeros = -2 * np.pi * edges_hz[0:-1:2], -2 * np.pi * edges_hz[1::2]
    middle = 2j * np.pi * math.sqrt(low_hz * high_hz)
    shape = abs(np.prod(middle - zeros) / np.prod(middle - poles))
    wanted = math.sqrt(2 * np.pi * corner_hz / abs(middle))
    sections: FloatArray = scipy.signal.zpk2sos(
        *scipy.signal.bilinear_zpk(zeros, poles, wanted / shape, rate_hz)
    )
    return sections
