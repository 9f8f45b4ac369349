"""Models of the evidence document: bearings, and comparisons of their films with baselines."""

import math
from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from service.live.models import BaselineOriginModel, BudgetLineModel, FilmCauseModel
from service.runtime.models import ByName, Finite, Time, ValueModel
from service.settings.alarm_kinds import AlarmLevelName

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$", examples=["9f86d081884c7d65" * 4])]

Numbers = list[float | None]
"""Column of numbers; null for missing numbers."""


class EvidencePart(ValueModel):
    """Base class of the models that make up the evidence document."""

    model_config = ConfigDict(frozen=True)


def rounded(number: float | None) -> float | None:
    """Return a number rounded to seven significant digits, or None if it is not finite."""
    return None if number is None or not math.isfinite(number) else float(f"{number:.7g}")


Direction = Literal["x", "y"]

QualityWord = Literal["good", "uncertain", "bad"]

AXES: tuple[Direction, Direction] = ("x", "y")
"""Directions, in the order of all pairs of x and y."""


class ReadingPart(EvidencePart):
    """Reading of a quantity of the catalogue, with quality and uncertainty."""

    value: Finite
    """Value of the quantity; null if unknown."""

    unit: Annotated[str, Field(examples=["N/m"])]
    """Unit of measurement, with the detector if there is one."""

    level: Annotated[QualityWord, ByName]
    """Quality of the reading."""

    reason: Annotated[str, Field(examples=["ok"])]
    """Reason for the quality."""

    u_random: Finite
    """Random standard uncertainty, in the unit of the value; null if unknown."""

    u_systematic: Finite
    """Systematic standard uncertainty, in the unit of the value; null if unknown."""

    interval_95: tuple[float, float] | None
    """95 % confidence interval, in the unit of the value; null if unknown."""


class EstimatorPart(EvidencePart):
    """Estimate of the stiffness of a film by one estimator."""

    estimator: Annotated[str, Field(examples=["dynamic"])]
    """Name of the estimator."""

    direction: Direction
    """Direction of the stiffness."""

    stiffness: ReadingPart
    """Estimated stiffness."""

    coherence: Finite
    """Magnitude-squared coherence that the estimate is based on; null without waveforms."""

    is_preferred: bool
    """Whether this estimate is the stiffness among the readings of the bearing."""

    is_watched: bool
    """Whether film monitoring uses this estimator."""


class WindowPart(EvidencePart):
    """Window of samples that the results were computed from."""

    epoch: int
    """Epoch of the device's sample counter."""

    first_index: int
    """Sample index of the first sample."""

    stop_index: int
    """Sample index after the last sample."""

    n_segments: int
    """Number of averaged segments."""

    n_segments_wanted: int
    """Number of segments of a full average."""

    coverage: float
    """Fraction of the possible segments that was usable."""

    duration_s: float
    """Time from the first to the last sample, in seconds."""


class ConditionPart(EvidencePart):
    """Operating condition of the bearing."""

    state: Annotated[str, ByName, Field(examples=["full_load"])]
    """Operating state of the unit."""

    is_settled: bool
    """Whether the state had lasted for the settling time, after the warm-up."""

    cell: list[int] | None
    """Bins of eccentricity, oil temperature and, if used, attitude; null if unknown."""

    bounds: list[tuple[float, float]] | None
    """Limits of the cell along each of these axes, [low, high]; null if `cell` is null."""


class CausePart(FilmCauseModel):
    """Cause of a stiffness change, with the changes of motion of shaft and bearing behind it."""

    shaft_change: Finite
    """Change of the shaft motion against the expected motion, ln of the ratio; null if unknown."""

    bearing_change: Finite
    """Change of the bearing's motion against the expected motion, ln of the ratio, or null."""


class FindingPart(EvidencePart):
    """Finding about stiffness or damping of a film in one direction."""

    direction: Direction
    """Direction of the film."""

    is_damping: bool = False
    """Whether the finding is on damping over stiffness, c/k, instead of on stiffness."""

    verdict: Annotated[str, ByName, Field(examples=["alert"])]
    """Verdict: normal, alert, danger, or the reason why the film was not judged."""

    level: Annotated[AlarmLevelName, ByName] | None
    """Alarm level of the film; null without an alarm."""

    change_percent: Finite
    """Most significant mean deviation, % of the expected value; null if there is none yet."""

    time_scale_h: Finite
    """Running hours over which `change_percent` was averaged; null if that is null."""

    deviation_percent: Finite
    """Deviation of the newest reading, % of the expected value; null unless it was compared."""

    deviation_95_percent: tuple[float, float] | None
    """95 % interval of `deviation_percent`; null if that is null."""

    baseline_version: int | None
    """Version of the baseline; null without a baseline."""

    attribution: CausePart | None
    """Cause of the change; null without an alarm level."""


class FilmReadingPart(EvidencePart):
    """Newest judged reading of the films of a bearing."""

    time: Time
    """Time of the reading."""

    estimator: Annotated[str, Field(examples=["dynamic"])]
    """Estimator of the stiffness."""

    state: Annotated[str, ByName, Field(examples=["full_load"])]
    """Operating state of the unit."""

    is_settled: bool
    """Whether the unit had settled in the operating state."""

    findings: list[FindingPart]
    """Findings in x and in y."""


class BearingPart(EvidencePart):
    """State of one bearing at the time of the alarm."""

    bearing: Annotated[str, Field(examples=["UJB"])]
    """Identifier of the bearing."""

    time: Time
    """Time of the last sample of the window."""

    window: WindowPart
    """Window of samples that the results were computed from."""

    evidence: Annotated[str, Field(examples=["waveforms"])]
    """Evidence class: waveforms, amplitude_and_phase or amplitude_only."""

    speed_source: Annotated[str, Field(examples=["slow_channel"])]
    """Source of the running speed."""

    condition: ConditionPart | None
    """Operating condition; null if operation is not monitored."""

    readings: dict[str, ReadingPart]
    """Readings by their name in the catalogue."""

    estimators: list[EstimatorPart]
    """Stiffness estimates of all estimators."""

    budgets: dict[str, list[BudgetLineModel]]
    """Uncertainty budgets by quantity."""

    film: FilmReadingPart | None
    """Findings about the films of the bearing; null if not monitored or not judged yet."""


class BaselinePart(BaselineOriginModel):
    """Baseline of a bearing."""

    scatter: float
    """Scatter of single readings about the expected stiffness, over all cells, in ln."""


class CellPart(EvidencePart):
    """Cell of the baseline, a bin of operating conditions."""

    cell: list[int]
    """Bins of eccentricity, oil temperature and, if used, attitude."""

    n_readings: int
    """Number of readings in the cell."""

    n_days: int
    """Number of days with readings in the cell."""

    location: float
    """Median stiffness of the readings, in the unit of the comparison."""

    scatter: float
    """Scatter of the readings, in ln."""

    surface_std: float
    """Standard uncertainty of the expected stiffness, in ln."""

    support: Literal["none", "borrowed", "own"]
    """Support of the cell: none (not judged), borrowed from neighbouring cells, or own readings."""


class TimeScalePart(EvidencePart):
    """Mean deviation from the baseline over one time scale."""

    time_scale_h: float
    """Time scale, in running hours."""

    change: float
    """Mean deviation, in ln."""

    std: float
    """Standard uncertainty of the mean deviation of a healthy film."""

    sure_from: float
    """Number of standard uncertainties above which the change is significant."""


class MembersPart(EvidencePart):
    """Readings of the current cell in the learning period of the baseline, by column."""

    n_in_all: int
    """Number of readings in the cell; of many readings, an evenly spaced selection is listed."""

    time: Numbers
    """Times of the readings, in seconds since 1970 UTC."""

    stiffness: Numbers
    """Stiffness, in the unit of the comparison."""

    u_random: Numbers
    """Random standard uncertainty of ln stiffness."""

    eccentricity_ratio: Numbers
    """Eccentricity ratio."""

    oil_temperature_c: Numbers
    """Oil temperature, in °C."""


class ExpectedPart(EvidencePart):
    """Expected stiffness against eccentricity at the oil temperature of the reading, by column."""

    eccentricity_ratio: Numbers
    """Eccentricity ratio."""

    stiffness: Numbers
    """Expected stiffness, in the unit of the comparison; null if unknown."""


class ComparisonPart(EvidencePart):
    """Comparison of a film in one direction with its baseline."""

    bearing: Annotated[str, Field(examples=["UJB"])]
    """Identifier of the bearing."""

    direction: Direction
    """Direction of the stiffness."""

    estimator: Annotated[str, Field(examples=["dynamic"])]
    """Estimator of the stiffness."""

    time: Time
    """Time of the reading."""

    stiffness: Finite
    """Measured stiffness; null if missing."""

    stiffness_unit: Literal["N/m", "k_b"]
    """Unit of all stiffnesses: N/m or, if it is unknown, the stiffness of the bracket."""

    u_random: Finite
    """Random standard uncertainty of ln stiffness; null if unknown."""

    eccentricity_ratio: Finite
    """Eccentricity ratio of the reading; null if unknown."""

    oil_temperature_c: Finite
    """Oil temperature of the reading, in °C; null if unknown."""

    attitude_deg: Finite
    """Attitude angle of the reading, in degrees; null if unknown."""

    expected_stiffness: Finite
    """Expected stiffness by the baseline; null if unknown for this condition."""

    baseline: BaselinePart | None
    """Baseline; null if the bearing had none."""

    cell: CellPart | None
    """Cell of the reading; null if the baseline has no readings in this cell."""

    bounds: list[tuple[float, float]] | None
    """Limits [low, high] of the cell in eccentricity ratio, oil temperature in °C and, if used,
    attitude in degrees; null if the cell is unknown."""

    time_scales: list[TimeScalePart]
    """Mean deviations over all time scales; empty without a baseline with these time scales."""

    members: MembersPart | None
    """Readings in the cell; null if the store was unreadable or the cell is unknown."""

    expected: ExpectedPart | None
    """Expected stiffness; null without a baseline or without an oil temperature."""

    map: list[CellPart]
    """All cells of the baseline; empty without a baseline."""
