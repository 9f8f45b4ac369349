"""What the plant does to an alarm: conditions in, transitions out.

Nothing here knows a clock: a rule on data is given the times of the samples, so that the same
samples lead to the same events however fast they are played.
"""

from dataclasses import replace

from core.alarms.alarm import Alarm, AlarmChange, AlarmEvent, AlarmRule, changed
from core.limits import ON, RESTED, AlarmLevel, Condition, DelayTimer

Timers = tuple[DelayTimer, DelayTimer]


def advance(
    alarm: Alarm, condition: Condition, now_ns: int, rule: AlarmRule
) -> tuple[Alarm, tuple[AlarmEvent, ...]]:
    """Take in what is found now.

    What is not known changes nothing: an active alarm stays active and says that its condition is
    unknown, a pending one stays pending with its time standing still.
    """
    events: list[AlarmEvent] = []
    if condition.suppressed_by is not None:
        alarm = _suppress(events, alarm, condition.suppressed_by, now_ns)
    alarm = _find(events, alarm, condition, now_ns)
    alarm = _judge(events, alarm, now_ns, rule)
    if condition.suppressed_by is None and alarm.suppressed_by is not None:
        shown = shown_again(replace(alarm, suppressed_by=None))
        alarm = _note(events, alarm, shown, AlarmChange.UNSUPPRESSED, now_ns, alarm.suppressed_by)
    return alarm, tuple(events)


def interrupted(alarm: Alarm) -> Alarm:
    """The alarm where samples are missing: the time in between decides nothing."""
    return replace(alarm, timers=_paused(alarm.timers))


def shown_again(alarm: Alarm) -> Alarm:
    """What nothing hides any more is announced anew if it is active (ISA-18.2, G or H to B)."""
    return replace(alarm, is_acknowledged=alarm.is_acknowledged and alarm.level is None)


def restored(alarm: Alarm) -> Alarm:
    """The alarm after a restart: nothing that was pending still is, what was active is."""
    level = None if alarm.is_latched else alarm.level
    alert, danger = (ON if (level or 0) >= each else RESTED for each in AlarmLevel)
    return replace(alarm, timers=(alert, danger))


def standing_level(timers: Timers) -> AlarmLevel | None:
    """The worst level that counts now, the latch apart."""
    return max((n for n, t in zip(AlarmLevel, timers, strict=True) if t.is_on), default=None)


def _suppress(events: list[AlarmEvent], alarm: Alarm, reason: str, now_ns: int) -> Alarm:
    after = replace(alarm, suppressed_by=reason)
    if alarm.suppressed_by is not None:
        return after
    return _note(events, alarm, after, AlarmChange.SUPPRESSED, now_ns, reason)


def _find(events: list[AlarmEvent], alarm: Alarm, condition: Condition, now_ns: int) -> Alarm:
    """Remember what was found; while it is not known, what was known last."""
    last = alarm.condition
    if not condition.is_known:
        condition = replace(condition, level=last.level, value=last.value, limit=last.limit)
    after = replace(alarm, condition=condition)
    told = alarm.level is not None and alarm.suppressed_by is None
    if not told or condition.is_known == last.is_known:
        return after
    change = AlarmChange.CONDITION_KNOWN if condition.is_known else AlarmChange.CONDITION_UNKNOWN
    return _note(events, alarm, after, change, now_ns, condition.reason)


def _judge(events: list[AlarmEvent], alarm: Alarm, now_ns: int, rule: AlarmRule) -> Alarm:
    """Let time pass for the levels, and say what has come of it."""
    timers = _stepped(alarm, now_ns, rule)
    before, now, held = standing_level(alarm.timers), standing_level(timers), alarm.level
    alarm = replace(alarm, timers=timers)
    reason = alarm.condition.reason
    if now is not None and now > (before or 0) and (alarm.is_latched or now > (held or 0)):
        return _announce(events, alarm, now, now_ns)
    if now == held or alarm.is_latched:
        return alarm
    if rule.is_latching:
        latched = replace(alarm, is_latched=True)
        return _note(events, alarm, latched, AlarmChange.LATCHED, now_ns, reason)
    change = AlarmChange.RETURNED if now is None else AlarmChange.EASED
    return _note(events, alarm, replace(alarm, level=now), change, now_ns, reason)


def _announce(events: list[AlarmEvent], alarm: Alarm, level: AlarmLevel, now_ns: int) -> Alarm:
    """Begin a new occurrence, to be acknowledged by itself."""
    held = alarm.level
    after = replace(
        alarm,
        level=max(level, held or level),
        occurrence=alarm.occurrence + 1,
        is_acknowledged=False,
        raised_ns=now_ns,
        raised_at=alarm.condition.point,
        is_latched=held is not None and held > level,
    )
    rises = held is not None and not alarm.is_latched
    change = AlarmChange.ESCALATED if rises else AlarmChange.RAISED
    return _note(events, alarm, after, change, now_ns, alarm.condition.reason)


def _stepped(alarm: Alarm, now_ns: int, rule: AlarmRule) -> Timers:
    if not alarm.condition.is_known:
        return _paused(alarm.timers)
    level = alarm.condition.level or 0
    alert, danger = (
        timer.step(level >= each, now_ns, rule.on_delay_ns, rule.off_delay_ns)
        for each, timer in zip(AlarmLevel, alarm.timers, strict=True)
    )
    return alert, danger


def _paused(timers: Timers) -> Timers:
    alert, danger = timers
    return alert.paused(), danger.paused()


def _note(
    events: list[AlarmEvent],
    before: Alarm,
    after: Alarm,
    change: AlarmChange,
    now_ns: int,
    reason: str,
) -> Alarm:
    after, event = changed(before, after, change, now_ns, reason=reason)
    events.append(event)
    return after
