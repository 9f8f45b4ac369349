"""API models of baselines, and of requests that change baselines."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.parameters import Moment
from service.api.routes.learning import LearningModel
from service.api.values import (
    ActorModel,
    ApiModel,
    BearingAnswer,
    EstimatorName,
    ReasonText,
    Time,
)
from service.live.models import BaselineOriginModel

BaselineStatusName = Literal["in_force", "rejected", "superseded", "learned"]

BaselineStepName = Literal[
    "learned", "accepted", "rejected", "withdrawn", "frozen", "thawed", "renewed"
]

SupportName = Literal["own", "borrowed", "none"]


class BaselineVersionModel(BaselineOriginModel, ApiModel):
    """Version of the learned baseline of a bearing, without its cells."""

    estimator: EstimatorName

    status: BaselineStatusName
    """Status: in force; rejected by an engineer; superseded by another version or by a machine
    event; or learned and not yet accepted by an engineer."""

    remark: Annotated[str, Field(examples=["x is 5.1 % below that of version 1"])]
    """Reason why this version was not accepted automatically, remark on its readings, or empty."""

    is_frozen: bool
    """Whether this version is in force and an engineer has frozen learning."""


class BaselineStepModel(ApiModel):
    """Step in the history of the baselines of a bearing."""

    actor: str
    reason: str

    step: BaselineStepName
    """Kind of step."""

    version: int | None
    """Version of the baseline; null for "renewed"."""

    time: Time
    """Time of the step."""

    event_time: Time | None
    """For "renewed", time of the machine event; earlier readings are not used."""


class BaselinesModel(BearingAnswer):
    """All baseline versions of a bearing, and their history."""

    estimator: EstimatorName | None

    in_force: int | None
    """Number of the version in force; null if no version is in force."""

    is_frozen: bool
    """Whether an engineer has frozen learning."""

    renewed: Time | None
    """Time of the newest machine event; earlier readings are not used. Null without an event."""

    acceptance: Literal["automatic", "by_engineer"]
    """Acceptance of learned baselines: "automatic" if a baseline agrees with the previous one, or
    always "by_engineer"."""

    learning: LearningModel | None
    """Progress of learning; null if the bearing is not watched."""

    versions: list[BaselineVersionModel]
    """Versions of the baseline, newest first."""

    steps: list[BaselineStepModel]
    """Steps in the history of the baselines, newest first."""


class BaselineCellsModel(ApiModel):
    """Cells of a baseline in the grid of operating conditions, one value per cell in each list."""

    eccentricity_low: list[float]
    eccentricity_high: list[float]
    oil_temperature_low_c: list[float]
    oil_temperature_high_c: list[float]
    attitude_low_deg: list[float] | None
    attitude_high_deg: list[float] | None
    stiffness_of_kb: list[float | None]

    eccentricity_ratio: list[float]
    """Median eccentricity ratio of the readings in the cell."""

    oil_temperature_c: list[float]
    """Median oil temperature of the readings in the cell, °C."""

    n_readings: list[int]
    """Number of readings learned in the cell; 0 in a cell without readings between other cells."""

    n_days: list[int]
    """Number of days with readings in the cell."""

    stiffness_n_per_m: list[float | None]
    """Median stiffness of the readings, or of the fitted surface without readings, N/m; null if the
    bracket stiffness was unknown."""

    scatter_percent: list[float]
    """Robust standard deviation of single readings about the fitted stiffness surface, %."""

    surface_std_percent: list[float]
    """Standard uncertainty of the fitted surface at the median condition of the cell, %."""

    support: list[SupportName]
    """Basis on which new readings in the cell are judged: learned readings of the cell ("own"), of
    neighbouring cells ("borrowed"), or no basis ("none")."""


class BaselineDirectionModel(ApiModel):
    """Learned stiffness of an oil film in one direction, x or y."""

    scatter_percent: float

    cells: BaselineCellsModel
    """Cells with readings, and cells between them."""


class BaselineModel(BearingAnswer):
    """Baseline of a bearing: learned stiffness by cell of the operating-condition grid."""

    about: BaselineVersionModel
    x: BaselineDirectionModel | None
    y: BaselineDirectionModel | None

    eccentricity_width: float | None
    """Width of the cells in eccentricity ratio; null if nothing was learned."""

    oil_temperature_width_c: float | None
    """Width of the cells in oil temperature, K; null if nothing was learned."""


class BaselineActionModel(ActorModel):
    """Request to change baselines, with a reason."""

    reason: ReasonText


class RenewModel(BaselineActionModel):
    """Request to renew the baseline after a machine event."""

    event_time: Annotated[Moment, Field(strict=False, examples=["2026-11-21T08:00:00Z"])]
    """End of the machine event, RFC 3339 with offset; only later readings are used."""
