"""`Alarm`: what is known of one alarm, and the words of its life cycle."""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

from core.condition.cells import OperatingPoint
from core.limits import NEVER_JUDGED, RESTED, AlarmLevel, Condition, DelayTimer


class AlarmState(StrEnum):
    """Where an alarm stands in its life cycle (ISA-18.2, 5.4: states A to H, latches apart)."""

    NORMAL = "normal"
    UNACKNOWLEDGED = "unacknowledged"
    ACKNOWLEDGED = "acknowledged"
    RETURNED_UNACKNOWLEDGED = "returned_unacknowledged"
    SHELVED = "shelved"
    SUPPRESSED = "suppressed"
    OUT_OF_SERVICE = "out_of_service"


class AlarmKind(StrEnum):
    """What is wrong, in a word that is part of the alarm's identity."""

    CHANNEL_NOT_OK = "channel_not_ok"
    SHAFT_X = "order1_shaft_x"
    SHAFT_Y = "order1_shaft_y"
    CHANGE_SHAFT_X = "order1_change_shaft_x"
    CHANGE_SHAFT_Y = "order1_change_shaft_y"
    CHANGE_BEARING_X = "order1_change_bearing_x"
    CHANGE_BEARING_Y = "order1_change_bearing_y"
    OVERALL_SHAFT_X = "overall_shaft_x"
    OVERALL_SHAFT_Y = "overall_shaft_y"
    OVERALL_BEARING_X = "overall_bearing_x"
    OVERALL_BEARING_Y = "overall_bearing_y"
    ZONE_SHAFT_X = "zone_shaft_x"
    ZONE_SHAFT_Y = "zone_shaft_y"
    ZONE_SHAFT = "zone_shaft"
    ZONE_BEARING_X = "zone_bearing_x"
    ZONE_BEARING_Y = "zone_bearing_y"
    ECCENTRICITY = "eccentricity_ratio"
    GAP_X = "gap_x"
    GAP_Y = "gap_y"
    OPPOSITE_GAP_X = "opposite_gap_x"
    OPPOSITE_GAP_Y = "opposite_gap_y"
    OIL_TEMPERATURE = "oil_temperature"
    STIFFNESS_X = "stiffness_x"
    STIFFNESS_Y = "stiffness_y"
    CLOCK_OFFSET = "clock_offset"
    CLOCK_DRIFT = "clock_drift"
    TIME_STAMPS = "time_stamps"
    LINK_LOST = "link_lost"
    SAMPLES_LOST = "samples_lost"
    RESULTS_NOT_STORED = "results_not_stored"
    RESULTS_LOST = "results_lost"
    BLOCKS_WAITING = "blocks_waiting"
    ANALYSIS_LATE = "analysis_late"
    CAPTURES_NOT_KEPT = "captures_not_kept"
    SAMPLES_NOT_RECORDED = "samples_not_recorded"
    RECORDINGS_DAMAGED = "recordings_damaged"
    QUESTIONS_REFUSED = "questions_refused"
    DISK_NEARLY_FULL = "disk_nearly_full"
    STORED_DATA_DAMAGED = "stored_data_damaged"
    MESSAGES_REFUSED = "messages_refused"
    STREAM_AWAY = "stream_away"
    ANALYSIS_GONE = "analysis_gone"


PLANT = "plant"
"""In the place of a unit: what concerns all of them. No unit may be called so."""


@dataclass(frozen=True)
class AlarmIdentity:
    """Which alarm: the same for as long as the plant calls its parts by the same names.

    Parameters
    ----------
    unit
        `PLANT` where it is about the service itself.
    subject
        Channel or bearing that it is about; "device" or "link" where it is about the whole unit,
        "store", "service" or "captures" where it is about the service.
    """

    unit: str
    subject: str
    kind: AlarmKind

    @cached_property
    def id(self) -> str:
        """All of it in one word, fit for a URL."""
        return f"{self.unit}:{self.subject}:{self.kind}"


@dataclass(frozen=True)
class Hold:
    """That somebody has taken an alarm off the list, and why.

    Parameters
    ----------
    until_ns
        When that ends by itself, host time; None if never.
    """

    actor: str
    reason: str
    since_ns: int
    until_ns: int | None = None


@dataclass(frozen=True)
class AlarmRule:
    """How long a condition must last, and whether what it raised stays.

    Parameters
    ----------
    on_delay_ns, off_delay_ns
        Known time without interruption before a level counts, or counts no longer.
    is_latching
        Whether the alarm stays active after its condition has gone, until it is reset.
    """

    on_delay_ns: int = 0
    off_delay_ns: int = 0
    is_latching: bool = False


@dataclass(frozen=True)
class Alarm:
    """One alarm at one moment.

    Parameters
    ----------
    level
        Of the alarm itself, after delays and latch; None if it is not active.
    occurrence
        How often it was raised or rose in level; the number that is acknowledged.
    is_acknowledged
        Whether somebody has seen this occurrence.
    raised_ns
        When this occurrence began.
    raised_at
        Under which operating condition; None where that was not known.
    n_events
        How many events it has had; the newest has this number.
    condition
        What was found last.
    suppressed_by
        Why it counts for nothing by design; None if it counts.
    shelf, outage
        Whether somebody has shelved it, or taken it out of service.
    is_latched
        Whether only its latch keeps it at its level.
    timers
        Of alert and danger.
    """

    identity: AlarmIdentity
    level: AlarmLevel | None = None
    occurrence: int = 0
    is_acknowledged: bool = True
    raised_ns: int | None = None
    raised_at: OperatingPoint | None = None
    n_events: int = 0
    condition: Condition = NEVER_JUDGED
    suppressed_by: str | None = None
    shelf: Hold | None = None
    outage: Hold | None = None
    is_latched: bool = False
    timers: tuple[DelayTimer, DelayTimer] = (RESTED, RESTED)

    @property
    def state(self) -> AlarmState:
        """State of the life cycle; what hides an alarm most thoroughly names it."""
        if self.outage is not None:
            return AlarmState.OUT_OF_SERVICE
        if self.shelf is not None:
            return AlarmState.SHELVED
        if self.suppressed_by is not None:
            return AlarmState.SUPPRESSED
        if self.level is None:
            returned = AlarmState.RETURNED_UNACKNOWLEDGED
            return AlarmState.NORMAL if self.is_acknowledged else returned
        return AlarmState.ACKNOWLEDGED if self.is_acknowledged else AlarmState.UNACKNOWLEDGED

    @cached_property
    def is_resting(self) -> bool:
        """Whether it would not be changed by one more condition that is known and within limits."""
        return (
            self.level is None
            and self.condition.is_known
            and self.condition.level is None
            and self.suppressed_by is None
            and self.timers == (RESTED, RESTED)
        )
