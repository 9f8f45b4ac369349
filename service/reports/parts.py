"""Parts of the document of a bundle: bearings, and what their films are compared with."""

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$", examples=["9f86d081884c7d65" * 4])]

Moment = Annotated[str, Field(examples=["2026-11-21T09:03:12.400Z"])]
"""UTC, RFC 3339."""

Numbers = list[float | None]
"""Column of numbers; null where there is none."""


class EvidencePart(BaseModel):
    """Base of all parts: frozen, without unknown keys, NaN or infinity."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True
    )


def finite(number: float | None) -> float | None:
    """Return a finite number; None otherwise, since JSON has no NaN or infinity."""
    return None if number is None or not math.isfinite(number) else float(number)


def rounded(number: float | None) -> float | None:
    """Return a number rounded to seven digits, beyond the accuracy of any result."""
    found = finite(number)
    return None if found is None else float(f"{found:.7g}")


Direction = Literal["x", "y"]

LevelWord = Literal["alert", "danger"]

QualityWord = Literal["good", "uncertain", "bad"]

AXES: tuple[Direction, Direction] = ("x", "y")
"""Order of all pairs."""


class ReadingPart(EvidencePart):
    """Reading of a quantity of the catalogue."""

    value: float | None
    """Value; null if unknown."""

    unit: Annotated[str, Field(examples=["N/m"])]
    """Unit and detector."""

    level: QualityWord
    """Level of quality."""

    reason: Annotated[str, Field(examples=["ok"])]
    """Reason for the level."""

    u_random: float | None
    """Random standard uncertainty, in the unit of the value."""

    u_systematic: float | None
    """Systematic standard uncertainty."""

    interval_95: tuple[float, float] | None
    """95 % confidence interval."""


class EstimatorPart(EvidencePart):
    """Stiffness of a film by one estimator."""

    estimator: Annotated[str, Field(examples=["dynamic"])]
    """Name of the estimator."""

    direction: Direction
    """Direction."""

    stiffness: ReadingPart
    """Estimated stiffness."""

    coherence: float | None
    """Squared coherence behind the estimate; null without waveforms."""

    is_preferred: bool
    """Whether `stiffness` of the bearing is taken from it."""

    is_watched: bool
    """Whether changes of the film are judged by it."""


class BudgetLinePart(EvidencePart):
    """One contribution to the uncertainty of a result."""

    name: Annotated[str, Field(examples=["bracket stiffness"])]
    """Name of the contribution."""

    kind: Literal["random", "systematic"]
    """Whether the contribution varies between results or is constant."""

    distribution: Literal["normal", "uniform"]
    """Distribution of the contribution."""

    width: float
    """Standard uncertainty if normal, half-width if uniform, in the unit of the contribution."""

    sensitivity: float
    """Change of the result per unit of the contribution."""

    contribution: float
    """Standard uncertainty of the result by this contribution alone."""


class WindowPart(EvidencePart):
    """Samples behind the results."""

    epoch: int
    """Epoch of the device's sample counter."""

    first_index: int
    """Index of the first sample."""

    stop_index: int
    """Index after the last sample."""

    n_segments: int
    """Number of averaged segments."""

    n_segments_wanted: int
    """Number of segments of a full average."""

    coverage: float
    """Fraction of the possible segments that was usable."""

    duration_s: float
    """Time from the first to the last sample."""


class ConditionPart(EvidencePart):
    """Operating condition of the bearing."""

    state: Annotated[str, Field(examples=["full_load"])]
    """Operating state of the unit."""

    is_settled: bool
    """Whether the state had lasted for the settling time, after the warm-up."""

    cell: list[int] | None
    """Bins of eccentricity, oil temperature and, if used, attitude; null if unknown."""

    bounds: list[tuple[float, float]] | None
    """Limits of the cell along each of these axes."""


class CausePart(EvidencePart):
    """Cause to which a change is attributed."""

    cause: Annotated[str, Field(examples=["film"])]
    """Cause: film, oil, bracket_or_transducer or unknown."""

    reason: Annotated[str, Field(examples=["shaft motion does not tell"])]
    """Reason for the attribution."""

    film_share: float | None
    """Fraction of the change due to the film if the rest is due to an accelerometer."""

    film_share_std: float | None
    """Its standard uncertainty."""

    shaft_change: float | None
    """Motion of the shaft relative to the expected motion, in ln."""

    bearing_change: float | None
    """Motion of the bearing relative to the expected motion, in ln."""


class FindingPart(EvidencePart):
    """Finding about a film in one direction."""

    direction: Direction
    """Direction."""

    verdict: Annotated[str, Field(examples=["alert"])]
    """Verdict: normal, alert, danger, or the reason why there is none."""

    level: LevelWord | None
    """Alarm level of the film."""

    change: float | None
    """Most significant mean deviation from the baseline, in ln."""

    change_std: float | None
    """Its standard uncertainty."""

    time_scale_h: float | None
    """Running hours of the average."""

    deviation: float | None
    """Deviation of the newest reading, in ln; null unless it was compared."""

    deviation_std: float | None
    """Standard uncertainty of that deviation."""

    baseline_version: int | None
    """Version of the baseline."""

    attribution: CausePart | None
    """Cause of the change, while there is an alarm level."""


class FilmReadingPart(EvidencePart):
    """Last judged reading of the films."""

    time: Moment
    """Time of the reading."""

    estimator: Annotated[str, Field(examples=["dynamic"])]
    """Estimator of the stiffness."""

    state: Annotated[str, Field(examples=["full_load"])]
    """Operating state."""

    is_settled: bool
    """Whether the unit had settled in it."""

    findings: list[FindingPart]
    """Findings in x and in y."""


class BearingPart(EvidencePart):
    """State of one bearing at the time of the alarm."""

    bearing: Annotated[str, Field(examples=["UJB"])]
    """Identifier."""

    time: Moment
    """End of the samples."""

    window: WindowPart
    """Samples behind the results."""

    evidence: Annotated[str, Field(examples=["waveforms"])]
    """Evidence class: waveforms, amplitude_and_phase or amplitude_only."""

    speed_source: Annotated[str, Field(examples=["slow_channel"])]
    """Source of the running speed."""

    condition: ConditionPart | None
    """Operating condition; null if operation is not monitored."""

    readings: dict[str, ReadingPart]
    """Readings by name in the catalogue."""

    estimators: list[EstimatorPart]
    """Estimates of all estimators."""

    budgets: dict[str, list[BudgetLinePart]]
    """Uncertainty budgets by quantity."""

    film: FilmReadingPart | None
    """Findings about its films; null if they are not monitored, or not judged yet."""


class BaselinePart(EvidencePart):
    """Baseline of a bearing."""

    version: int
    """Number of the baseline of the bearing."""

    author: Annotated[str, Field(examples=["padwatch"])]
    """Person or program that had it learned."""

    created: Moment
    """Time of creation."""

    event: str
    """Event on the machine that required it; may be empty."""

    learned_from: Moment
    """Time of the first learned reading."""

    learned_until: Moment
    """Time of the last learned reading."""

    scatter: float
    """Scatter of single readings about the expected stiffness, over all cells, in ln."""


class CellPart(EvidencePart):
    """Cell of the baseline."""

    cell: list[int]
    """Bins of eccentricity, oil temperature and, if used, attitude."""

    n_readings: int
    """Number of readings."""

    n_days: int
    """Number of days with readings."""

    location_n_per_m: float
    """Median stiffness."""

    scatter: float
    """Scatter of the readings, in ln."""

    surface_std: float
    """Standard uncertainty of the expected stiffness, in ln."""

    support: Literal["none", "borrowed", "own"]
    """Whether readings in it can be judged."""


class TimeScalePart(EvidencePart):
    """Mean deviation over one time scale."""

    time_scale_h: float
    """Running hours."""

    change: float
    """Mean deviation, in ln."""

    std: float
    """Standard uncertainty of the mean deviation of a healthy film."""

    sure_from: float
    """Number of standard uncertainties from which the change is significant."""


class MembersPart(EvidencePart):
    """Readings of the cell behind the baseline, by column."""

    n_in_all: int
    """Number of readings; those listed are spread evenly over them."""

    time: Numbers
    """Seconds since 1970 UTC."""

    stiffness_n_per_m: Numbers
    """Stiffness."""

    u_random: Numbers
    """Random standard uncertainty of its logarithm."""

    eccentricity_ratio: Numbers
    """Eccentricity ratio."""

    oil_temperature_c: Numbers
    """Oil temperature, °C."""


class ExpectedPart(EvidencePart):
    """Expected stiffness by eccentricity at the oil temperature of the reading, by column."""

    eccentricity_ratio: Numbers
    """Eccentricity ratio."""

    stiffness_n_per_m: Numbers
    """Expected stiffness; null if unknown."""


class ComparisonPart(EvidencePart):
    """Film in one direction, and the baseline that it is compared with."""

    bearing: Annotated[str, Field(examples=["UJB"])]
    """Bearing."""

    direction: Direction
    """Direction."""

    estimator: Annotated[str, Field(examples=["dynamic"])]
    """Estimator of the stiffness."""

    time: Moment
    """Time of the reading."""

    stiffness_n_per_m: float | None
    """Measured stiffness."""

    u_random: float | None
    """Random standard uncertainty of its logarithm."""

    eccentricity_ratio: float | None
    """Eccentricity ratio of the reading."""

    oil_temperature_c: float | None
    """Oil temperature of the reading, °C."""

    attitude_deg: float | None
    """Attitude angle of the reading."""

    expected_n_per_m: float | None
    """Stiffness expected by the baseline; null if it has none for this condition."""

    baseline: BaselinePart | None
    """Baseline; null if there was none."""

    cell: CellPart | None
    """Cell of the reading; null if the baseline has no readings in it."""

    bounds: list[tuple[float, float]] | None
    """Limits of the cell in eccentricity, oil temperature and, if used, attitude."""

    time_scales: list[TimeScalePart]
    """Mean deviations over all time scales."""

    members: MembersPart | None
    """Readings of the cell; null if they are unreadable, or there is no cell."""

    expected: ExpectedPart | None
    """Expected stiffness; null without a baseline."""

    map: list[CellPart]
    """All cells of the baseline."""
