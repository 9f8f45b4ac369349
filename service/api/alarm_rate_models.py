"""What the API answers about how often alarms come."""

from typing import Annotated

from pydantic import Field

from service.api.alarm_models import AlarmIdText, AlarmModel
from service.api.alarm_names import AlarmLevelName
from service.api.models import ApiModel, Time

UnitKey = Annotated[str, Field(examples=["U1"])]


class FrequentModel(ApiModel):
    """An alarm that came often."""

    alarm: AlarmIdText
    """The alarm."""

    n_alarms: int
    """How often it was announced."""

    share: float
    """Of all that was announced."""


class AlarmFiguresModel(ApiModel):
    """Figures of an alarm list after ISA-18.2."""

    n_alarms: int
    """How often something was announced: raised, risen to danger, or back from where it was
    hidden."""

    per_day: Annotated[float, Field(examples=[3.4])]
    """Alarms a day, on average."""

    per_10_min: Annotated[float, Field(examples=[0.02])]
    """Alarms in ten minutes, on average."""

    most_in_10_min: int
    """Alarms in the worst ten minutes."""

    share_in_flood: float
    """Of the ten-minute periods, those with more than ten alarms."""

    n_by_level: dict[AlarmLevelName, int]
    """By priority."""

    share_by_level: dict[AlarmLevelName, float]
    """By priority, as shares; of nothing, 0."""

    most_frequent: list[FrequentModel]
    """At most ten, the most frequent first."""

    chattering: dict[AlarmIdText, int]
    """How often each alarm was raised in bursts: so often within chattering_window_s as the plant
    file calls chattering."""

    n_fleeting: int
    """Alarms that returned within that time."""


class AlarmRatesModel(ApiModel):
    """How often alarms came over some time, and which have been standing for more than a day."""

    start: Time
    """From when; later than asked for if there were too many events to read."""

    end: Time
    """Until when."""

    is_complete: bool
    """Whether all events from the time asked for have been counted."""

    all: AlarmFiguresModel
    """Of everything that was asked for."""

    units: dict[UnitKey, AlarmFiguresModel]
    """Of each unit, and of "plant" where something concerns the service itself."""

    stale: list[AlarmModel]
    """On the list and active for more than a day now, the oldest first."""
