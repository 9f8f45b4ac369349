"""`AlarmMemory`: what a unit's alarms remember beside their events."""

from collections.abc import Mapping
from dataclasses import dataclass

from core.alarms.alarm import Alarm
from core.condition.operating_state import OperatingState
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
    state, state_ns
        Newest operating state, and when that was.
    stop
        Epoch and index up to which blocks were taken in.
    is_connected, link_reason
        What was said of the link last.
    """

    alarms: tuple[Alarm, ...]
    segment_faults: Mapping[str, Reason]
    state: OperatingState | None
    state_ns: int
    stop: tuple[int, int] | None
    is_connected: bool
    link_reason: str | None
