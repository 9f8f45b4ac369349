"""What the API answers about baselines, and what engineers ask of them."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from service.api.alarm_requests import Actor, Words
from service.api.models import ApiModel, EstimatorName, RequestModel, Time
from service.api.parameters import written_as_date

BaselineStatusName = Literal["in_force", "rejected", "superseded", "learned"]

BaselineStepName = Literal[
    "learned", "accepted", "rejected", "withdrawn", "frozen", "thawed", "renewed"
]

SupportName = Literal["own", "borrowed", "none"]


class BaselineVersionModel(ApiModel):
    """A learned baseline without its cells."""

    version: Annotated[int, Field(examples=[3])]
    """Counts the baselines of the bearing, from 1."""

    estimator: EstimatorName
    """Whose stiffness was learned."""

    status: BaselineStatusName
    """In force; rejected by an engineer; superseded by another, or by a machine event; or learned
    and waiting for an engineer to accept it."""

    author: str
    """Who had it learned."""

    created: Time
    """When it was learned, by the host's clock."""

    learned_from: Time
    """First reading of the learning period."""

    learned_until: Time
    """Last one."""

    event: str
    """What happened to the machine that made it necessary; empty if nothing did."""

    remark: Annotated[str, Field(examples=["-5.1 % from version 1 under like conditions"])]
    """Why it was not put in force by itself, or what was noticed in its readings; empty if nothing
    was."""

    is_frozen: bool
    """Whether it is in force and nothing more is learned until an engineer says so."""


class BaselineStepModel(ApiModel):
    """What was done to the baselines of a bearing."""

    step: BaselineStepName
    """What."""

    version: int | None
    """To which of them; null for "renewed"."""

    time: Time
    """When."""

    actor: str
    """Who did it."""

    reason: str
    """Why."""

    event_time: Time | None
    """For "renewed": when the machine event was; older readings count no longer."""


class ReadingCountsModel(ApiModel):
    """What became of the readings of the last days: why a film is not learned or judged."""

    days: Annotated[float, Field(examples=[7.0])]
    """How far back."""

    n_at_speed: Annotated[int, Field(examples=[180])]
    """At rated speed."""

    n_settled: Annotated[int, Field(examples=[0])]
    """Of these, after the warm-up. None of many: each run ends before the film is warm."""

    n_complete: int
    """Of these, with stiffness, eccentricity and oil temperature in both directions; the direction
    that has fewer."""

    n_judged: int
    """Of these, with a verdict on the film; likewise."""


class LearningModel(ApiModel):
    """How far learning has come."""

    since: Time | None
    """From when on readings count: the first one, or the last machine event; null without any."""

    until: Time | None
    """When the learning period ends; then the baseline stands still until it is renewed."""

    is_over: bool
    """Whether it has ended."""

    n_readings: int | None
    """Settled readings that count so far; null once there is a baseline of this period."""

    n_days: Annotated[int | None, Field(examples=[12])]
    """Days that they are from; likewise."""

    n_days_wanted: Annotated[int, Field(examples=[20])]
    """Days with readings before there is a baseline at all."""

    recent: ReadingCountsModel
    """The last days."""


class BaselinesModel(ApiModel):
    """All baselines of a bearing and what was done to them."""

    unit: str
    """Unit."""

    bearing: str
    """Bearing."""

    estimator: EstimatorName | None
    """Whose stiffness is watched; null if the bearing is not watched."""

    in_force: int | None
    """Version that readings are compared with; null if there is none."""

    is_frozen: bool
    """Whether nothing more is learned until an engineer says so."""

    renewed: Time | None
    """Last machine event from which on readings count; null if there was none."""

    acceptance: Literal["automatic", "by_engineer"]
    """Whether padwatch puts a learned baseline in force that agrees with the one before, or only an
    engineer does."""

    learning: LearningModel | None
    """Null if the bearing is not watched."""

    versions: list[BaselineVersionModel]
    """Newest first."""

    steps: list[BaselineStepModel]
    """What was done, newest first."""


class BaselineCellsModel(ApiModel):
    """Cells by column; each column has a value for each cell."""

    eccentricity_low: list[float]
    """Eccentricity ratio from which on."""

    eccentricity_high: list[float]
    """Up to which."""

    oil_temperature_low_c: list[float]
    """Oil temperature from which on, °C."""

    oil_temperature_high_c: list[float]
    """Up to which."""

    attitude_low_deg: list[float] | None
    """Attitude angle from which on; null where the attitude does not part cells."""

    attitude_high_deg: list[float] | None
    """Up to which, likewise."""

    eccentricity_ratio: list[float]
    """Middle of what the cell has seen."""

    oil_temperature_c: list[float]
    """Likewise, °C."""

    n_readings: list[int]
    """Readings that count; 0 in a cell that lies between others and has seen nothing itself."""

    n_days: list[int]
    """Days that they are from."""

    stiffness_n_per_m: list[float]
    """Median of the readings; of a cell without any, what the surface says."""

    scatter_percent: list[float]
    """Robust standard deviation of single readings about the surface, %."""

    surface_std_percent: list[float]
    """Standard uncertainty of the surface in the middle of the cell, %."""

    support: list[SupportName]
    """Whether readings in the cell are judged: by what it has seen itself ("own"), by what cells
    around it have ("borrowed"), or not ("none")."""


class TimeScatterModel(ApiModel):
    """How far means of a healthy film stray."""

    time_scale_h: float
    """Running hours over which is averaged."""

    share: float
    """Standard deviation of the means over that of single readings."""


class BaselineDirectionModel(ApiModel):
    """What was learned of stiffness in one direction."""

    cells: BaselineCellsModel
    """Every cell that has readings, and those between them."""

    scatter_percent: float
    """Typical scatter of single readings, %."""

    u_random_percent: float
    """Typical random uncertainty of single readings, %; part of their scatter."""

    rejected_share: float
    """Share of the learning period that fitted so badly that it counted as nothing."""

    time_scatter: list[TimeScatterModel]
    """Shortest time scale first."""


class BaselineModel(ApiModel):
    """One baseline with its cells."""

    unit: str
    """Unit."""

    bearing: str
    """Bearing."""

    about: BaselineVersionModel
    """Where it comes from and where it stands."""

    eccentricity_width: float | None
    """Width of a cell in eccentricity ratio; null if nothing was learned."""

    oil_temperature_width_c: float | None
    """Width of a cell in oil temperature, K; likewise."""

    x: BaselineDirectionModel | None
    """In x; null if there were too few readings."""

    y: BaselineDirectionModel | None
    """In y, likewise."""


class BaselineActionModel(RequestModel):
    """Who does something to baselines, and why."""

    actor: Actor | None = None
    """Who, 1 to 80 printable characters; the name of a login or a key goes before it."""

    reason: Words
    """Why, 1 to 500 printable characters."""


def _only_text(value: object) -> object:
    """Refuse numbers, which say neither since when nor in what they count."""
    if not isinstance(value, str):
        raise ValueError("a time is written like 2026-11-21T08:00:00Z")
    return written_as_date(value)


class RenewModel(BaselineActionModel):
    """That a machine event has made another machine of it."""

    event_time: Annotated[
        datetime,
        BeforeValidator(_only_text),
        Field(strict=False, examples=["2026-11-21T08:00:00Z"]),
    ]
    """When the event was over, RFC 3339 with offset: readings from then on count."""
