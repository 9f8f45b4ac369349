"""Table of all alarm kinds: alarms of the generating units, and alarms about the service itself."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from core.alarms import kinds as units
from core.alarms.kinds import AlarmKind, kind_table
from core.limits import AlarmLevel

STORE, SERVICE, CAPTURES, DISK = "store", "service", "captures", "disk"
RECORDINGS, STREAM, UNIT = "recordings", "stream", "unit"
"""Subjects of alarms about the service; the subject `UNIT` stands for the id of a unit."""

SAMPLES_LOST, ANALYSIS_GONE, MESSAGES_REFUSED = "samples_lost", "analysis_gone", "messages_refused"
"""Alarm kinds of the service with one alarm for each unit."""

OVERLOAD_ADVICE = "This computer is overloaded; stop other programs on it."

SERVICE_KINDS = kind_table(
    AlarmKind(
        SAMPLES_LOST,
        "Samples lost",
        "1",
        UNIT,
        "loss",
        advice="Check the network, and the load of the DAQ and of this computer.",
    ),
    AlarmKind("results_not_stored", "Results are not being stored", "s", STORE, "store_behind"),
    AlarmKind("results_lost", "Results lost", "findings", STORE, "lasting"),
    AlarmKind(
        "blocks_waiting",
        "Analysis queue filling up",
        "1",
        SERVICE,
        "waiting",
        "waiting_share",
        advice=OVERLOAD_ADVICE,
    ),
    AlarmKind(
        "analysis_late",
        "Analysis falls behind",
        "s",
        SERVICE,
        "delay",
        "analysis_delay_s",
        advice=OVERLOAD_ADVICE,
    ),
    AlarmKind(
        "captures_not_kept",
        "Samples around alarms not saved",
        None,
        CAPTURES,
        "at_once",
        "captures_error",
    ),
    AlarmKind(
        "samples_not_recorded",
        "Samples not recorded",
        None,
        RECORDINGS,
        "at_once",
        "recording_error",
    ),
    AlarmKind(
        "recordings_damaged", "Recordings damaged or missing", "recordings", RECORDINGS, "lasting"
    ),
    AlarmKind("disk_nearly_full", "Disk nearly full", "1", DISK, "steady"),
    AlarmKind(
        "stored_data_damaged",
        "Stored data damaged or missing",
        None,
        STORE,
        "at_once",
        "stored_trouble",
    ),
    AlarmKind(MESSAGES_REFUSED, "Messages in the stream rejected", None, STREAM, "lasting"),
    AlarmKind("stream_away", "Stream unavailable", None, STREAM, "steady", "stream_trouble"),
    AlarmKind(ANALYSIS_GONE, "No process analyses this unit", None, UNIT, "at_once"),
)
"""Alarm kinds of the service. `rule` is a key of `service_rules_of`; `reading` is a key of
`ServiceHealth.readings`, whose value is compared with limits or is the text of a fault."""

DANGER_KINDS = frozenset(("stored_data_damaged", "stream_away"))
"""Alarm kinds of the service whose fault is a danger; a fault of other kinds is an alert."""

ALARM_KINDS: Mapping[str, AlarmKind] = MappingProxyType({**units.ALARM_KINDS, **SERVICE_KINDS})

SAMPLED_KINDS = frozenset(
    kind.name for kind in ALARM_KINDS.values() if kind.subject in (units.CHANNEL, units.BEARING)
)
"""Names of the alarm kinds whose subject is a channel or a bearing."""

if TYPE_CHECKING:
    AlarmKindName = str
else:
    AlarmKindName = Literal[tuple(ALARM_KINDS)]
"""Name of an alarm kind, validated by pydantic."""


def kind_words(kind: str, directions: str = "") -> str:
    """Return the label of an alarm kind in lower case: "film stiffness changed, x and y".

    ``directions`` are the letters of the directions ("xy"), or empty. The label of an unknown kind
    is its name without underscores.
    """
    found = ALARM_KINDS.get(kind)
    name = kind.replace("_", " ") if found is None else found.label
    label = ", ".join(filter(None, (name, " and ".join(directions))))
    return label[:1].lower() + label[1:]


def value_unit(kind: str) -> str | None:
    """Return the unit of the values of an alarm kind; None if it has no value or is unknown."""
    found = ALARM_KINDS.get(kind)
    return None if found is None else found.unit


AlarmLevelName = Literal["alert", "danger"]

LEVEL_NAMES: dict[AlarmLevel, AlarmLevelName] = {
    AlarmLevel.ALERT: "alert",
    AlarmLevel.DANGER: "danger",
}
