"""Which lines of a spectrum carry broadband motion alone: those away from strong tones."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.spectra.spectral_statistics import leakage_kernel


@dataclass(frozen=True)
class LineSelection:
    """Where lines are taken from.

    Parameters
    ----------
    guard_bins
        To each side of every harmonic of the running speed. Hann's main lobe reaches 2 bins; the
        third takes up what the tone wanders within a segment.
    max_leakage
        Largest share of a line's shaft power that may have come through side lobes of stronger
        lines. Leakage carries runout, and it carries the wrong frequency into integration.
    """

    guard_bins: float = 3.0
    max_leakage: float = 0.005

    def __post_init__(self) -> None:
        if self.guard_bins < 0.0 or not self.max_leakage > 0.0:
            raise ValueError(
                f"guard of {self.guard_bins} bins and leakage of {self.max_leakage}"
                " must be at least 0 and above 0"
            )


def between_harmonics(
    frequency_hz: FloatArray, turn_hz: tuple[float, float], guard_bins: float
) -> npt.NDArray[np.bool_]:
    """Tell which lines lie between the harmonics of the running speed.

    Parameters
    ----------
    frequency_hz : (n_lines,)
        Evenly spaced.
    turn_hz
        Lowest and highest 1× frequency that was measured during the averaging time; the guard of
        the n-th harmonic spans n times that.

    Raises
    ------
    ValueError
        If the frequencies are not positive and in order.
    """
    lowest, highest = turn_hz
    if not 0.0 < lowest <= highest:
        raise ValueError(f"1× must lie between positive limits in order, got {turn_hz} Hz")
    guard_hz = guard_bins * (frequency_hz[1] - frequency_hz[0])
    # harmonic n guards a line f if n · lowest - guard <= f <= n · highest + guard
    last = np.floor((frequency_hz + guard_hz) / lowest)
    first = np.maximum(np.ceil((frequency_hz - guard_hz) / highest), 1.0)
    clear: npt.NDArray[np.bool_] = first > last
    return clear


def little_leakage(shaft_power: FloatArray, max_leakage: float) -> npt.NDArray[np.bool_]:
    """Tell which lines are their own, not the side lobes of stronger ones.

    Parameters
    ----------
    shaft_power : (n_lines, n_channels)

    Returns
    -------
    (n_lines,)
    """
    leaked = leakage_kernel(shaft_power.shape[0]) @ shaft_power
    own: npt.NDArray[np.bool_] = np.all(leaked <= max_leakage * shaft_power, axis=1)
    return own
