"""`AlarmMemory`: what a unit's alarms remember beside their events."""

from collections.abc import Mapping
from dataclasses import dataclass

from core.alarms.alarm import Alarm
from core.condition.bearing_condition import OperatingPoint
from core.quality import Reason


@dataclass(frozen=True)
class AlarmMemory:
    """The alarms of a unit at one moment, so that they go on elsewhere as if nothing were.

    Parameters
    ----------
    alarms
        With their delays.
    segment_faults
        What only segments show of channels, by channel.
    points
        Newest operating condition of each bearing, and when that was.
    stop
        Epoch and index up to which blocks were taken in.
    is_connected, link_reason
        What was said of the link last.
    """

    alarms: tuple[Alarm, ...]
    segment_faults: Mapping[str, Reason]
    points: Mapping[str, tuple[OperatingPoint, int]]
    stop: tuple[int, int] | None
    is_connected: bool
    link_reason: str | None

    def link_by(self, alarm: Alarm) -> tuple[bool, str | None]:
        """Whether samples arrive as far as is known, and why not.

        Parameters
        ----------
        alarm
            About the link, by its newest event. What came of it since all this was remembered
            counts more: a link that was lost then stays lost until samples come.
        """
        kept = next((a for a in self.alarms if a.identity == alarm.identity), Alarm(alarm.identity))
        if is_same_occurrence(kept, alarm):
            return self.is_connected, self.link_reason
        return (True, None) if alarm.level is None else (False, alarm.condition.reason)


def is_same_occurrence(one: Alarm, other: Alarm) -> bool:
    """Whether an alarm has neither been raised nor returned between two moments."""
    return (one.level, one.occurrence) == (other.level, other.occurrence)
