"""How the analysis is set up; the defaults are the paper's (Brito et al., section 3.1)."""

from dataclasses import dataclass, field

from core.dynamic_settings import DynamicSettings
from core.sensor_checks import SensorLimits


@dataclass(frozen=True)
class AnalysisSettings:
    """Segments, averaging and what counts as evidence.

    Parameters
    ----------
    segment_samples
        Points of one Hann-tapered segment.
    overlap
        Share of a segment that the next one repeats.
    n_segments
        Segments that are averaged; 24 at 600 Hz are about five minutes.
    max_frequency_hz
        Spectra are kept up to here.
    vortex_order
        Nominal frequency of the part-load vortex in multiples of the running speed.
    vortex_band
        Orders within which its peak is looked for.
    min_segments
        Below this number of segments a result is marked uncertain.
    min_coherence
        Squared coherence of shaft and bearing motion below which there is no stiffness. At 0.9, a
        bearing line that is noise to the rest makes equation (5) read 5 % high.
    min_line_to_floor
        Power of a line over the median of its surroundings, in both signals, that stands for the
        coherence while there are too few segments to know that.
    min_coverage
        Share of the wanted segments below which a result is marked uncertain.
    sensors
        What counts as a failed transducer or an unsteady record.
    dynamic
        How all eight coefficients are sought.
    velocity_low_order, velocity_high_hz
        Band of a bearing's broad-band velocity: from this multiple of the rated speed (a quarter
        takes in everything down to the vortex) to this frequency.
    min_speed_fraction
        Share of the rated speed below which the machine counts as standing.
    """

    segment_samples: int = 8192
    overlap: float = 0.125
    n_segments: int = 24
    max_frequency_hz: float = 25.0
    vortex_order: float = 0.25
    vortex_band: tuple[float, float] = (0.2, 0.4)
    min_segments: int = 4
    min_coherence: float = 0.9
    min_line_to_floor: float = 10.0
    min_coverage: float = 0.5
    min_speed_fraction: float = 0.2
    velocity_low_order: float = 0.25
    velocity_high_hz: float = 1000.0
    sensors: SensorLimits = field(default_factory=SensorLimits)
    dynamic: DynamicSettings = field(default_factory=DynamicSettings)

    @property
    def hop_samples(self) -> int:
        """Samples from one segment's start to the next one's."""
        return self.segment_samples - round(self.segment_samples * self.overlap)
