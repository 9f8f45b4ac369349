"""The alarm list, as everything that shows it sees it."""

from collections.abc import Sequence
from typing import Protocol

from core.alarms.alarm import Alarm
from core.alarms.statistics import ChatterRule
from service.live.alarm_count import AlarmCount


class AlarmBoard(Protocol):
    """All alarms as they are; see :class:`service.measuring.alarms.engine.AlarmEngine`."""

    @property
    def revision(self) -> int:
        """Another number as soon as anything is known otherwise of any alarm."""
        ...

    @property
    def chatter_rule(self) -> ChatterRule:
        """What counts as chattering."""
        ...

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All alarms, whatever their state."""
        ...

    def alarm(self, id_: str) -> Alarm:
        """Look an alarm up. Raises `LookupError` if there is none."""
        ...

    def is_judged(self, alarm: Alarm) -> bool:
        """Whether what an alarm watches is known now."""
        ...

    def is_chattering(self, alarm: Alarm) -> bool:
        """Whether an alarm has come and gone too often until a short while ago."""
        ...

    def count(self) -> AlarmCount:
        """How many alarms are on the list."""
        ...
