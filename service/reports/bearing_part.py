"""What was known of one bearing: readings, estimators side by side, budgets, its films."""

from typing import Annotated, Literal

from pydantic import Field

from service.reports.part import EvidencePart, Moment

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
