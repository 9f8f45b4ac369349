"""Alarms about what comes of a unit over the stream."""

from collections.abc import Iterable

from core.alarms.alarm import AlarmIdentity
from core.alarms.kinds import Watch
from core.alarms.rules import rule_of
from core.limits import WITHIN, AlarmLevel, Judgement
from service.measuring.alarms.told_alarms import ToldAlarms
from service.settings.alarm_kinds import MESSAGES_REFUSED, STREAM

REFUSED_FOR_S = 600.0
"""How long an alarm stands after the last message that was refused."""

MAX_REASON = 200
"""Longest reason, letters: a message that is refused may hold anything."""


def stream_alarms(units: Iterable[str]) -> ToldAlarms:
    """Alarms about messages of units that cannot be used."""
    alarms = ToldAlarms(
        Watch(_refused(unit), rule_of(0.0, REFUSED_FOR_S), STREAM) for unit in units
    )
    for alarm in alarms.alarms:
        alarms.tell(alarm.identity.id, WITHIN)
    return alarms


def refuse(alarms: ToldAlarms, unit: str, reason: str) -> None:
    """Note that a message of a unit was refused."""
    words = "".join(c if c.isprintable() else "?" for c in reason[:MAX_REASON])
    alarms.tell_once(_refused(unit).id, Judgement(AlarmLevel.ALERT, reason=words))


def _refused(unit: str) -> AlarmIdentity:
    return AlarmIdentity(unit, STREAM, MESSAGES_REFUSED)
