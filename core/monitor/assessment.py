"""Results of one evaluation of a bearing, and the settings of the analysis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from core.arrays import SampleArray
from core.condition.cells import BearingCondition
from core.machine.unit import Estimator
from core.quality import Quality, Reading
from core.spectra.cross_spectrum import CrossSpectrum
from core.spectra.lines import SegmentSettings
from core.spectra.overall import RecentReadings
from core.spectra.runout import RunoutVerdict
from core.spectra.segments import Evidence
from core.spectra.speed import SpeedSource
from core.stiffness.dynamic_lines import DynamicSettings
from core.uncertainty import Budget


@dataclass(frozen=True)
class AnalysisSettings(SegmentSettings):
    """Settings of segments, averaging, required evidence, and the `dynamic` estimator."""

    dynamic: DynamicSettings = field(default_factory=DynamicSettings)


@dataclass(frozen=True)
class AveragingWindow:
    """Range of samples over which a result is averaged.

    Parameters
    ----------
    first_index, stop_index
        Sample indices in this epoch; the last sample is ``stop_index - 1``.
    n_segments
        Number of segments in which all four channels were usable.
    n_segments_wanted
        Number of segments in a full averaging window.
    n_voided
        Number of segments interrupted by gaps or restarts since the service started.
    coverage
        `n_segments` as a fraction of the segments possible since the epoch began, at most a full
        window; 0 to 1.
    """

    epoch: int
    first_index: int
    stop_index: int
    n_segments: int
    n_segments_wanted: int
    n_voided: int
    coverage: float
    duration_s: float


@dataclass(frozen=True)
class OrbitTrace:
    """Shaft orbit in a bearing over the newest turns.

    Parameters
    ----------
    start_ns
        Time of the first sample, UTC nanoseconds since 1970.
    shaft_x_um, shaft_y_um : (n_samples,)
        Displacement samples without their mean.
    """

    start_ns: int
    rate_hz: float
    shaft_x_um: SampleArray
    shaft_y_um: SampleArray


@dataclass(frozen=True)
class BearingResult:
    """Results of one evaluation of a bearing, without spectrum, orbit and recent values.

    Parameters
    ----------
    time_ns
        End of the newest segment, UTC nanoseconds since 1970.
    readings
        One reading for each quantity of :data:`core.monitor.catalogue.CATALOGUE`, and for each
        recorded slow channel of the bearing and of the unit.
    quality
        Quality of the bearing: the worst of its 1× amplitudes and its preferred stiffness.
    budgets
        Uncertainty budgets, by quantity; only of readings with known uncertainty.
    estimators
        Estimator that `stiffness` was taken from, by axes "xx" and "yy"; None without a value.
    runout
        Whether the slow-roll vector was subtracted from 1× of the newest segment, by "shaft_x" and
        "shaft_y".
    clipped_share
        Fraction of the newest segment's samples at an end of the converter's range, by "shaft_x",
        "shaft_y", "bearing_x" and "bearing_y"; empty without waveforms.
    evidence
        Kind of the input: waveforms, or vectors of a rack. Without waveforms there is no coherence,
        and equation (5) does not distinguish noise from motion.
    condition
        Operating condition of the bearing; None until the unit's operation was evaluated.
    """

    unit: str
    bearing: str
    time_ns: int
    window: AveragingWindow
    speed_source: SpeedSource
    quality: Quality
    readings: Mapping[str, Reading]
    budgets: Mapping[str, Budget]
    estimators: Mapping[str, Estimator | None]
    runout: Mapping[str, RunoutVerdict]
    clipped_share: Mapping[str, float] = field(default_factory=dict)
    evidence: Evidence = Evidence.WAVEFORMS
    condition: BearingCondition | None = None


@dataclass(frozen=True, kw_only=True)
class Assessment(BearingResult):
    """Results of one evaluation of a bearing.

    Parameters
    ----------
    spectrum
        Cross-spectrum of the displacements at the Fourier bins, µm²; empty for a rack.
    orbit
        Shaft orbit; None without speed, usable probes or waveforms.
    recent
        Vibration of the newest parts of the averaging window, oldest first; empty if unavailable.
    """

    spectrum: CrossSpectrum
    orbit: OrbitTrace | None
    recent: Sequence[RecentReadings] = ()
