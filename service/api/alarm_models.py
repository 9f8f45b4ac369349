"""What the API answers about alarms."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.alarm_names import (
    AlarmChangeName,
    AlarmLevelName,
    AlarmStateName,
)
from service.api.film_models import CellModel, FilmConditionModel, OperatingStateName
from service.api.models import ApiModel, Time
from service.settings.alarm_kinds import AlarmKindName

ConditionName = Literal["active", "within_limits", "unknown"]

OriginName = Literal["live", "replay"]

AlarmIdText = Annotated[str, Field(examples=["U1:ujb_shaft_x:channel_not_ok"])]


class HoldModel(ApiModel):
    """That somebody has taken an alarm off the list."""

    actor: str
    """Who."""

    reason: str
    """Why."""

    since: Time
    """Since when."""

    until: Time | None
    """Until when, if it ends by itself."""


class RaisedAtModel(ApiModel):
    """Operating condition under which an occurrence of an alarm was raised."""

    operating_state: OperatingStateName
    """What the unit did."""

    eccentricity_ratio: Annotated[float | None, Field(examples=[0.37])]
    """Share of the clearance by which the shaft was off centre; null if not known, as of alarms
    about no bearing."""

    attitude_deg: Annotated[float | None, Field(examples=[47.0])]
    """Attitude angle; null if not known."""

    oil_temperature_c: Annotated[float | None, Field(examples=[46.2])]
    """Oil temperature, °C; null if not known."""

    cell: CellModel | None
    """The condition cell that these lie in; null where one of them is not known."""


class AlarmModel(ApiModel):
    """One alarm now."""

    id: AlarmIdText
    """Stable identifier: unit, subject and kind."""

    unit: str
    """Unit; "plant" if it is about the service itself."""

    subject: str
    """Channel or bearing it is about; "device" or "link" if it is about the whole unit; of "plant",
    a part of the service, or the unit whose samples got lost."""

    kind: AlarmKindName
    """What is wrong."""

    state: AlarmStateName
    """Where it stands in its life cycle (ISA-18.2)."""

    level: AlarmLevelName | None
    """Its priority while it is active; null if it is not."""

    is_active: bool
    """Whether it is active, hidden or not."""

    is_acknowledged: bool
    """Whether somebody has seen its newest occurrence."""

    is_latched: bool
    """Whether only its latch keeps it active: its condition has gone, and it waits for a reset."""

    is_chattering: bool
    """Whether it has come and gone too often within a short time, until ten minutes ago."""

    occurrence: int
    """How often it was raised or rose in level; what is acknowledged."""

    raised: Time | None
    """When the newest occurrence began."""

    raised_at: RaisedAtModel | None
    """Under which operating condition; null if that was not known, or it was never raised."""

    condition: ConditionName
    """What it watches, now: "unknown" where there are no good data. That is never a return to
    normal: an active alarm stays active."""

    condition_reason: str
    """Why; "ok" if all is well."""

    value: Annotated[float | None, Field(examples=[163.2])]
    """What was compared with the limit; while the condition is unknown, the last that was known."""

    limit: Annotated[float | None, Field(examples=[150.0])]
    """The limit, where there is one."""

    value_unit: Annotated[str | None, Field(examples=["µm 0-pk"])]
    """Unit of value and limit."""

    film: FilmConditionModel | None
    """For kinds of film stiffness, the condition of the newest reading: operating state and cell;
    null for all others, and before the first reading."""

    suppressed_by: str | None
    """Why it counts for nothing by design; null if it counts."""

    shelf: HoldModel | None
    """Who has shelved it."""

    outage: HoldModel | None
    """Who has taken it out of service."""


class AlarmCountModel(ApiModel):
    """How many alarms there are."""

    n_active: int
    """Active and not hidden."""

    n_danger: int
    """Of these, at the level of danger."""

    n_unacknowledged: int
    """Not hidden, and nobody has seen their newest occurrence."""

    n_hidden: int
    """Shelved, suppressed or out of service."""

    n_unjudged: int
    """Not active, and what they watch is not known now."""


class AlarmListModel(ApiModel):
    """All alarms that are not normal, and those that cannot be judged."""

    time: Time
    """Now."""

    origin: OriginName
    """Whether this is live or a replay."""

    count: AlarmCountModel
    """How many there are."""

    alarms: list[AlarmModel]
    """Not normal; unacknowledged first, danger before alert, the newest first."""

    unjudged: list[AlarmModel]
    """Normal as far as was known last, but what they watch is not known now."""


class AlarmEventModel(ApiModel):
    """One line of an alarm's history."""

    id: int
    """Number in the store; later events have higher ones."""

    alarm: AlarmIdText
    """The alarm."""

    unit: str
    """Unit."""

    subject: str
    """Channel or bearing it is about."""

    kind: AlarmKindName
    """What is wrong."""

    number: int
    """Of this alarm's events, from 1 without a hole."""

    change: AlarmChangeName
    """What happened."""

    level: AlarmLevelName | None
    """Of the alarm after it; of one that has returned, that it had."""

    state_before: AlarmStateName
    """State before it."""

    state_after: AlarmStateName
    """State after it."""

    time: Time
    """When: by the samples where they decided, by the host where a person or a link did."""

    occurrence: int
    """Which occurrence of the alarm it belongs to."""

    value: float | None
    """What was compared with the limit."""

    limit: float | None
    """The limit, where there is one."""

    value_unit: str | None
    """Unit of value and limit."""

    actor: str
    """Who did it; empty if nobody did."""

    reason: str
    """Why."""

    raised_at: RaisedAtModel | None
    """Under which operating condition that occurrence was raised; null if that was not known."""


class AlarmEventsModel(ApiModel):
    """Some of the history of all alarms."""

    origin: OriginName
    """Whether this is live or a replay."""

    events: list[AlarmEventModel]
    """Newest first."""

    next_before: int | None
    """What to give as ``before`` for those that are older; null if there are none."""
