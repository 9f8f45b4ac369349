"""Alarms about units that nobody analyses, in whichever process does the shared work."""

from collections.abc import Iterable, Sequence

from core.alarms.alarm import PLANT, Alarm, AlarmIdentity
from core.alarms.kinds import Watch
from core.alarms.rules import rule_of
from core.limits import WITHIN, AlarmLevel, Judgement
from service.measuring.alarms.told_alarms import ToldAlarms
from service.settings.alarm_kinds import ANALYSIS_GONE

SHARED = "shared work"
"""In the place of a unit: reports and commands about these alarms. No unit can be called so."""


def is_shared(alarm: Alarm) -> bool:
    """Whether an alarm belongs to whoever does the shared work."""
    return alarm.identity.kind == ANALYSIS_GONE


def gone_alarms(units: Iterable[str]) -> ToldAlarms:
    """The alarms of some units; nothing is known yet of any."""
    return ToldAlarms(Watch(identity_of(unit), rule_of(0.0, 0.0), unit) for unit in units)


def judge(alarms: ToldAlarms, silent: Sequence[str], heard: Sequence[str], after_s: float) -> None:
    """Take in which units were heard of lately, and which were not."""
    reason = f"no sign of life for {after_s:g} s: is `padwatch analyse` running?"
    gone = Judgement(AlarmLevel.DANGER, reason=reason)
    for units, condition in ((silent, gone), (heard, WITHIN)):
        for unit in units:
            alarms.tell(identity_of(unit).id, condition)


def identity_of(unit: str) -> AlarmIdentity:
    """The alarm about a unit that nobody analyses."""
    return AlarmIdentity(PLANT, unit, ANALYSIS_GONE)
