"""What one evaluation of a bearing found, and the settings that it was made with."""

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
    """Segments, averaging, what counts as evidence, and how all eight coefficients are sought."""

    dynamic: DynamicSettings = field(default_factory=DynamicSettings)


@dataclass(frozen=True)
class AveragingWindow:
    """Which samples a result stands on.

    Parameters
    ----------
    first_index, stop_index
        Of the samples in this epoch; the last sample is ``stop_index - 1``.
    n_segments
        Segments in which all four channels were usable.
    n_segments_wanted
        Segments of a full average.
    n_voided
        Segments begun and lost to gaps or restarts since the service started.
    coverage
        Share of the segments that could have been in the window and are, 0 to 1.
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
    """The newest turns of the shaft in its bearing, means removed.

    Parameters
    ----------
    shaft_x_um, shaft_y_um
        (n_samples,) each.
    """

    start_ns: int
    rate_hz: float
    shaft_x_um: SampleArray
    shaft_y_um: SampleArray


@dataclass(frozen=True)
class Assessment:
    """Everything about one bearing at one refresh.

    Parameters
    ----------
    time_ns
        End of the newest segment, UTC.
    readings
        One for each quantity of :data:`core.monitor.catalogue.CATALOGUE`.
    quality
        Of the bearing as a whole: the worst of its 1× amplitudes and its preferred stiffness.
    budgets
        Where the uncertainty of a reading comes from, by quantity, where it is known.
    estimators
        Where `stiffness` came from, by axes "xx" and "yy"; None if there is none.
    spectrum
        At the bins; displacement, µm.
    runout
        Whether the slow-roll vector was taken off 1× of the newest segment, by "shaft_x" and
        "shaft_y".
    clipped_share
        Share of the newest segment's samples at an end of the converter's range, by "shaft_x" to
        "bearing_y"; empty without waveforms.
    recent
        Vibration just now, oldest first: of the newest parts of what `readings` average; empty if
        it is not known apart.
    evidence
        Waveforms, or what a rack has made of them: then there is no coherence, and equation (5)
        cannot tell noise from motion.
    condition
        Under which condition it was found; None until the unit's operation has been looked at.
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
