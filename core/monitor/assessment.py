"""Results of one evaluation of a bearing, and the settings of the analysis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from core.arrays import SampleArray
from core.condition.cells import BearingCondition
from core.machine.unit import Estimator
from core.quality import Quality, Reading
from core.spectra.cross_spectrum import CrossSpectrum
from core.spectra.overall import RecentReadings
from core.spectra.runout import RunoutVerdict
from core.spectra.segments import Evidence
from core.spectra.speed import SpeedSource
from core.stiffness.dynamic_lines import DynamicSettings
from core.stiffness.evidence import EvidenceSettings
from core.uncertainty import Budget


@dataclass(frozen=True)
class AnalysisSettings(EvidenceSettings):
    """Settings of segments, averaging, evidence and the fit of all eight film coefficients."""

    dynamic: DynamicSettings = field(default_factory=DynamicSettings)


@dataclass(frozen=True)
class AveragingWindow:
    """Range of the samples that a result averages.

    Parameters
    ----------
    first_index, stop_index
        Sample indices in this epoch; the last sample is ``stop_index - 1``.
    n_segments
        Number of segments in which all four channels were usable.
    n_segments_wanted
        Number of segments of a full average.
    n_voided
        Number of segments interrupted by gaps or restarts since the service started.
    coverage
        `n_segments` over the largest number possible in the window so far, 0 to 1.
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
    """Shaft orbit of the newest turns, means removed.

    Parameters
    ----------
    shaft_x_um, shaft_y_um
        Displacement samples, (n_samples,) each.
    """

    start_ns: int
    rate_hz: float
    shaft_x_um: SampleArray
    shaft_y_um: SampleArray


@dataclass(frozen=True)
class Assessment:
    """Results of one evaluation of a bearing.

    Parameters
    ----------
    time_ns
        End of the newest segment, UTC.
    readings
        One reading for each quantity of :data:`core.monitor.catalogue.CATALOGUE`.
    quality
        Quality of the bearing: the worst of its 1× amplitudes and its preferred stiffness.
    budgets
        Uncertainty budgets of the readings, by quantity, if known.
    estimators
        Estimator that `stiffness` was taken from, by axes "xx" and "yy"; None without a value.
    spectrum
        Cross-spectrum at the bins; displacement, µm.
    runout
        Whether the slow-roll vector was subtracted from 1× of the newest segment, by "shaft_x" and
        "shaft_y".
    clipped_share
        Fraction of the newest segment's samples at an end of the converter's range, by "shaft_x" to
        "bearing_y"; empty without waveforms.
    recent
        Vibration of the newest parts of the averaging window, oldest first; empty if unavailable.
    evidence
        Kind of the input: waveforms, or vectors of a rack. Vectors have no coherence; with them,
        equation (5) does not distinguish noise from motion.
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
    spectrum: CrossSpectrum
    orbit: OrbitTrace | None
    runout: Mapping[str, RunoutVerdict]
    clipped_share: Mapping[str, float] = field(default_factory=dict)
    recent: Sequence[RecentReadings] = ()
    evidence: Evidence = Evidence.WAVEFORMS
    condition: BearingCondition | None = None
