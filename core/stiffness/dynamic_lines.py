"""How all eight film coefficients are sought: settings, and which spectral lines are used."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.spectra.cross_spectrum import leakage_kernel


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


@dataclass(frozen=True)
class DynamicSettings:
    """Band, lines, weighting and evidence of the `dynamic` estimator.

    Parameters
    ----------
    band_hz
        Lines are taken from here, between the harmonics of the running speed.
    selection
        Distance from harmonics and from anything else that is strong and narrow.
    probe_noise_um2_per_hz
        Known one-sided noise density (x, y) of the shaft probes; ``None`` estimates it.
    quiet_band_hz
        Where it is estimated: the shaft hardly moves there, and what it moves shows in the
        bearing channels and is taken out.
    smoothing_reach_bins
        To each side, over which the residual spectrum is smoothed before it weighs the lines.
    n_iterations
        Of fitting and weighting; the third changes stiffness by less than 0.01 %.
    min_segments
        Below this there is no result.
    min_lines
        Usable lines below which there is no result.
    min_signal_share
        Share of the shaft's weighted motion, in its worst direction, that must not be noise.
    min_coherence
        Multiple coherence of bearing with shaft motion over the used lines, free of its bias.
    max_relative_uncertainty
        Random standard uncertainty of a direct stiffness over the larger direct one; beyond it
        the excitation is insufficient.
    overlap
        Share of a segment that the next one repeats.
    """

    band_hz: tuple[float, float] = (0.6, 12.0)
    selection: LineSelection = field(default_factory=LineSelection)
    probe_noise_um2_per_hz: tuple[float, float] | None = None
    quiet_band_hz: tuple[float, float] = (15.0, 25.0)
    smoothing_reach_bins: int = 6
    n_iterations: int = 4
    min_segments: int = 4
    min_lines: int = 12
    min_signal_share: float = 0.5
    min_coherence: float = 0.1
    max_relative_uncertainty: float = 0.2
    overlap: float = 0.125

    def __post_init__(self) -> None:
        for name, (low, high) in (("band", self.band_hz), ("quiet band", self.quiet_band_hz)):
            if not 0.0 < low < high:
                raise ValueError(f"{name} must rise from above 0 Hz, got {low} to {high} Hz")
        if min(self.smoothing_reach_bins, self.n_iterations, self.min_lines) < 1:
            raise ValueError("smoothing reach, iterations and least lines must be at least 1")
        if self.min_segments < 3:
            raise ValueError(f"two inputs need at least 3 segments, got {self.min_segments}")


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
