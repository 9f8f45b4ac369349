"""How all eight film coefficients are sought, and what counts as having found them."""

from dataclasses import dataclass, field

from core.stiffness.usable_lines import LineSelection


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
