"""Models of baselines, and of requests that change them."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from service.api.parameters import written_as_date
from service.api.values import (
    ActorModel,
    ApiModel,
    BearingAnswer,
    EstimatorName,
    ReasonText,
    Time,
)

BaselineStatusName = Literal["in_force", "rejected", "superseded", "learned"]

BaselineStepName = Literal[
    "learned", "accepted", "rejected", "withdrawn", "frozen", "thawed", "renewed"
]

SupportName = Literal["own", "borrowed", "none"]


class BaselineVersionModel(ApiModel):
    """A learned baseline without its cells."""

    version: Annotated[int, Field(examples=[3])]
    """Version of the baseline, from 1."""

    estimator: EstimatorName
    """Estimator of the learned stiffness."""

    status: BaselineStatusName
    """In force; rejected by an engineer; superseded by another, or by a machine event; or learned
    and waiting for an engineer to accept it."""

    author: str
    """Person or program that started the learning."""

    created: Time
    """Time of learning, by the host's clock."""

    learned_from: Time
    """Time of the first reading of the learning period."""

    learned_until: Time
    """Time of the last reading of the learning period."""

    event: str
    """Machine event that made it necessary; empty if there was none."""

    remark: Annotated[str, Field(examples=["-5.1 % from version 1 under like conditions"])]
    """Why it was not put in force automatically, or a remark on its readings; may be empty."""

    is_frozen: bool
    """Whether it is in force and learning is frozen by an engineer."""


class BaselineStepModel(ApiModel):
    """A step taken with the baselines of a bearing."""

    step: BaselineStepName
    """Kind of step."""

    version: int | None
    """Version concerned; null for "renewed"."""

    time: Time
    """Time of the step."""

    actor: str
    """Person or program that took the step."""

    reason: str
    """Reason."""

    event_time: Time | None
    """For "renewed", time of the machine event; older readings are not used."""


class ReadingCountsModel(ApiModel):
    """Counts of recent readings, which show why a film is not learned or judged."""

    days: Annotated[float, Field(examples=[7.0])]
    """Length of the period, days."""

    n_at_speed: Annotated[int, Field(examples=[180])]
    """Readings at rated speed."""

    n_settled: Annotated[int, Field(examples=[0])]
    """Of these, readings after the warm-up; 0 if every run ends before the film is warm."""

    n_complete: int
    """Of these, readings with stiffness, eccentricity and oil temperature, in the direction that
    has fewer."""

    n_judged: int
    """Of these, readings with a verdict on the film, likewise."""


class LearningModel(ApiModel):
    """Progress of learning."""

    since: Time | None
    """Start of the learning period: first reading or last machine event; null without readings."""

    until: Time | None
    """End of the learning period; afterwards the baseline does not change until it is renewed."""

    is_over: bool
    """Whether it has ended."""

    n_readings: int | None
    """Settled readings so far; null once this period has a baseline."""

    n_days: Annotated[int | None, Field(examples=[12])]
    """Days with such readings, likewise."""

    n_days_wanted: Annotated[int, Field(examples=[20])]
    """Days with readings that the first baseline needs."""

    recent: ReadingCountsModel
    """Counts of the last days."""


class BaselinesModel(BearingAnswer):
    """All baselines of a bearing, and the steps taken with them."""

    estimator: EstimatorName | None
    """Estimator whose stiffness is watched; null if the bearing is not watched."""

    in_force: int | None
    """Version in force; null if there is none."""

    is_frozen: bool
    """Whether learning is frozen by an engineer."""

    renewed: Time | None
    """Last machine event; only later readings are used; null if there was none."""

    acceptance: Literal["automatic", "by_engineer"]
    """Whether padwatch puts a learned baseline in force if it agrees with the previous one, or only
    an engineer does."""

    learning: LearningModel | None
    """Progress of learning; null if the bearing is not watched."""

    versions: list[BaselineVersionModel]
    """Versions, newest first."""

    steps: list[BaselineStepModel]
    """Steps, newest first."""


class BaselineCellsModel(ApiModel):
    """Cells by column; each column has one value per cell."""

    eccentricity_low: list[float]
    """Lower bound of the eccentricity ratio."""

    eccentricity_high: list[float]
    """Upper bound."""

    oil_temperature_low_c: list[float]
    """Lower bound of the oil temperature, °C."""

    oil_temperature_high_c: list[float]
    """Upper bound."""

    attitude_low_deg: list[float] | None
    """Lower bound of the attitude angle; null where cells do not depend on it."""

    attitude_high_deg: list[float] | None
    """Upper bound, likewise."""

    eccentricity_ratio: list[float]
    """Middle of the readings in the cell."""

    oil_temperature_c: list[float]
    """Middle of the readings in the cell, °C."""

    n_readings: list[int]
    """Readings used; 0 in a cell between others that has no readings."""

    n_days: list[int]
    """Days with such readings."""

    stiffness_n_per_m: list[float]
    """Median of the readings; in a cell without readings, value of the surface."""

    scatter_percent: list[float]
    """Robust standard deviation of single readings about the surface, %."""

    surface_std_percent: list[float]
    """Standard uncertainty of the surface in the middle of the cell, %."""

    support: list[SupportName]
    """Whether readings in the cell are judged: by its own readings ("own"), by those of
    neighbouring cells ("borrowed"), or not ("none")."""


class TimeScatterModel(ApiModel):
    """Scatter of means of a healthy film."""

    time_scale_h: float
    """Running hours of the average."""

    share: float
    """Standard deviation of the means over that of single readings."""


class BaselineDirectionModel(ApiModel):
    """Learned stiffness in one direction."""

    cells: BaselineCellsModel
    """Cells with readings, and cells between them."""

    scatter_percent: float
    """Typical scatter of single readings, %."""

    u_random_percent: float
    """Typical random uncertainty of single readings, %; part of their scatter."""

    rejected_share: float
    """Share of the learning period rejected as outliers."""

    time_scatter: list[TimeScatterModel]
    """Scatter by time scale, shortest first."""


class BaselineModel(BearingAnswer):
    """One baseline with its cells."""

    about: BaselineVersionModel
    """Origin and status."""

    eccentricity_width: float | None
    """Width of a cell in eccentricity ratio; null if nothing was learned."""

    oil_temperature_width_c: float | None
    """Width of a cell in oil temperature, K; likewise."""

    x: BaselineDirectionModel | None
    """Baseline in x; null if there were too few readings."""

    y: BaselineDirectionModel | None
    """Baseline in y, likewise."""


class BaselineActionModel(ActorModel):
    """Change of baselines, with a reason."""

    reason: ReasonText
    """Reason, 1 to 500 printable characters."""


def _only_text(value: object) -> object:
    """Reject numbers, whose epoch and unit are unknown."""
    if not isinstance(value, str):
        raise ValueError("a time is written like 2026-11-21T08:00:00Z")
    return written_as_date(value)


class RenewModel(BaselineActionModel):
    """Renewal of the baseline after a machine event."""

    event_time: Annotated[
        datetime,
        BeforeValidator(_only_text),
        Field(strict=False, examples=["2026-11-21T08:00:00Z"]),
    ]
    """End of the event, RFC 3339 with offset; only later readings are used."""
