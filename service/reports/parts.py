"""Parts of the document of a bundle: bearings and what they are compared with."""

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$", examples=["9f86d081884c7d65" * 4])]

Moment = Annotated[str, Field(examples=["2026-11-21T09:03:12.400Z"])]
"""UTC, RFC 3339."""

Numbers = list[float | None]
"""A column; null where there is no number."""


class EvidencePart(BaseModel):
    """Frozen, no unknown keys, no NaN or infinity; a field's docstring is its documentation."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True
    )


def finite(number: float | None) -> float | None:
    """Nothing, where JSON has no number for it."""
    return None if number is None or not math.isfinite(number) else float(number)


def rounded(number: float | None) -> float | None:
    """The same to seven digits: more than any result has, and half the space."""
    found = finite(number)
    return None if found is None else float(f"{found:.7g}")


Direction = Literal["x", "y"]

LevelWord = Literal["alert", "danger"]

QualityWord = Literal["good", "uncertain", "bad"]

AXES: tuple[Direction, Direction] = ("x", "y")
"""In the order of all that comes in pairs."""


class ReadingPart(EvidencePart):
    """One quantity of the catalogue."""

    value: float | None
    """Null if it could not be known."""

    unit: Annotated[str, Field(examples=["N/m"])]
    """Unit and detector."""

    level: QualityWord
    """How far it may be believed."""

    reason: Annotated[str, Field(examples=["ok"])]
    """Why not simply good."""

    u_random: float | None
    """Random standard uncertainty, in the unit of the value."""

    u_systematic: float | None
    """Systematic standard uncertainty."""

    interval_95: tuple[float, float] | None
    """Holds the truth with 95 %."""


class EstimatorPart(EvidencePart):
    """A film's stiffness by one estimator."""

    estimator: Annotated[str, Field(examples=["dynamic"])]
    """Which one."""

    direction: Direction
    """Direction."""

    stiffness: ReadingPart
    """What it says."""

    coherence: float | None
    """Squared coherence that it stands on; null without waveforms."""

    is_preferred: bool
    """Whether `stiffness` was taken from it."""

    is_watched: bool
    """Whether changes of the film are judged by it."""


class BudgetLinePart(EvidencePart):
    """One contribution to the uncertainty of a result."""

    name: Annotated[str, Field(examples=["bracket stiffness"])]
    """What contributes."""

    kind: Literal["random", "systematic"]
    """Whether it differs from one result to the next, or stays."""

    distribution: Literal["normal", "uniform"]
    """What is known about it besides its width."""

    width: float
    """Standard uncertainty if normal, half-width if uniform, in the unit of what contributes."""

    sensitivity: float
    """Change of the result per unit of what contributes."""

    contribution: float
    """Standard uncertainty of the result by this alone."""


class WindowPart(EvidencePart):
    """Which samples the results stand on."""

    epoch: int
    """Of the device's count."""

    first_index: int
    """Index of the first sample."""

    stop_index: int
    """Index after the last."""

    n_segments: int
    """Segments that were averaged."""

    n_segments_wanted: int
    """Segments of a full average."""

    coverage: float
    """Share of the possible segments that were usable."""

    duration_s: float
    """From first to last sample."""


class ConditionPart(EvidencePart):
    """Under which condition the bearing ran."""

    state: Annotated[str, Field(examples=["full_load"])]
    """Operating state of the unit."""

    is_settled: bool
    """Whether it had lasted for the settling time, after the warm-up."""

    cell: list[int] | None
    """Bins of eccentricity, oil temperature and, where it counts, attitude; null if not known."""

    bounds: list[tuple[float, float]] | None
    """Limits of the cell along each of them."""


class CausePart(EvidencePart):
    """What a change is put down to."""

    cause: Annotated[str, Field(examples=["film"])]
    """film, oil, bracket_or_transducer or unknown."""

    reason: Annotated[str, Field(examples=["shaft motion does not tell"])]
    """From what."""

    film_share: float | None
    """Part of the change that is the film's if the rest is an accelerometer's."""

    film_share_std: float | None
    """Its standard uncertainty."""

    shaft_change: float | None
    """By how much the shaft moves more than it would have, in ln."""

    bearing_change: float | None
    """The same of the bearing."""


class FindingPart(EvidencePart):
    """What was said of a film in one direction."""

    direction: Direction
    """Direction."""

    verdict: Annotated[str, Field(examples=["alert"])]
    """normal, alert, danger, or why nothing could be said."""

    level: LevelWord | None
    """Level that was held."""

    change: float | None
    """Most significant mean deviation from the baseline, in ln."""

    change_std: float | None
    """Its standard uncertainty."""

    time_scale_h: float | None
    """Running hours over which it was averaged."""

    deviation: float | None
    """Of the newest reading alone, in ln; null unless it was compared."""

    deviation_std: float | None
    """What that may stray by."""

    baseline_version: int | None
    """What it was compared with."""

    attribution: CausePart | None
    """What a change is put down to, while a level is held."""


class FilmReadingPart(EvidencePart):
    """The reading of the films that was judged last."""

    time: Moment
    """When."""

    estimator: Annotated[str, Field(examples=["dynamic"])]
    """By which estimator."""

    state: Annotated[str, Field(examples=["full_load"])]
    """Operating state."""

    is_settled: bool
    """Whether the unit had settled in it."""

    findings: list[FindingPart]
    """What was said of it, in x and in y."""


class BearingPart(EvidencePart):
    """One bearing at the moment of the alarm."""

    bearing: Annotated[str, Field(examples=["UJB"])]
    """Which one."""

    time: Moment
    """End of the samples."""

    window: WindowPart
    """Which samples."""

    evidence: Annotated[str, Field(examples=["waveforms"])]
    """Evidence class: waveforms, amplitude_and_phase or amplitude_only."""

    speed_source: Annotated[str, Field(examples=["slow_channel"])]
    """How the running speed was known."""

    condition: ConditionPart | None
    """Under which condition; null where operation is not watched."""

    readings: dict[str, ReadingPart]
    """By name from the catalogue."""

    estimators: list[EstimatorPart]
    """All estimators side by side."""

    budgets: dict[str, list[BudgetLinePart]]
    """Where uncertainties come from, by quantity."""

    film: FilmReadingPart | None
    """What was said of its films; null where they are not watched, or not yet."""


class BaselinePart(EvidencePart):
    """Which baseline."""

    version: int
    """Counts the baselines of the bearing."""

    author: Annotated[str, Field(examples=["padwatch"])]
    """Who had it learned."""

    created: Moment
    """When."""

    event: str
    """What happened to the machine that made it necessary; may be empty."""

    learned_from: Moment
    """First reading it knows."""

    learned_until: Moment
    """Last reading it knows."""

    scatter: float
    """Of single readings about what is expected, over all cells, in ln."""


class CellPart(EvidencePart):
    """One cell of the baseline."""

    cell: list[int]
    """Bins of eccentricity, oil temperature and, where it counts, attitude."""

    n_readings: int
    """Readings in it."""

    n_days: int
    """Days with readings."""

    location_n_per_m: float
    """Median of its readings."""

    scatter: float
    """Of its readings, in ln."""

    surface_std: float
    """Standard uncertainty of what is expected, in ln."""

    support: Literal["none", "borrowed", "own"]
    """Whether readings in it can be judged."""


class TimeScalePart(EvidencePart):
    """The mean deviation over one time scale."""

    time_scale_h: float
    """Running hours."""

    change: float
    """Mean deviation, in ln."""

    std: float
    """What a healthy film's would stray by."""

    sure_from: float
    """Standard uncertainties from which on it is sure."""


class MembersPart(EvidencePart):
    """Readings of the cell that the baseline stands on, by column."""

    n_in_all: int
    """How many there are; those that follow are spread evenly over them."""

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
    """What is expected along the eccentricity at the oil temperature of the reading, by column."""

    eccentricity_ratio: Numbers
    """Eccentricity ratio."""

    stiffness_n_per_m: Numbers
    """Expected stiffness; null where nothing is known."""


class ComparisonPart(EvidencePart):
    """A film in one direction, and what it was compared with."""

    bearing: Annotated[str, Field(examples=["UJB"])]
    """Bearing."""

    direction: Direction
    """Direction."""

    estimator: Annotated[str, Field(examples=["dynamic"])]
    """Whose stiffness."""

    time: Moment
    """Of the reading."""

    stiffness_n_per_m: float | None
    """What was measured."""

    u_random: float | None
    """Random standard uncertainty of its logarithm."""

    eccentricity_ratio: float | None
    """Under which eccentricity ratio."""

    oil_temperature_c: float | None
    """Under which oil temperature, °C."""

    attitude_deg: float | None
    """Attitude angle."""

    expected_n_per_m: float | None
    """What the baseline expects there; null if it knows nothing of it."""

    baseline: BaselinePart | None
    """Null if there was none."""

    cell: CellPart | None
    """Null if the baseline has not seen it."""

    bounds: list[tuple[float, float]] | None
    """Limits of the cell in eccentricity, oil temperature and, where it counts, attitude."""

    time_scales: list[TimeScalePart]
    """Mean deviations over all time scales."""

    members: MembersPart | None
    """Null if they could not be read, or there is no cell."""

    expected: ExpectedPart | None
    """Null without a baseline."""

    map: list[CellPart]
    """All cells of the baseline."""
