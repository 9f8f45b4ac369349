"""Alarm transitions caused by the plant (ISA-18.2), computed from judgements.

No function reads a clock. With sample times, a replay of the same samples produces the same events
at any speed.
"""

from collections.abc import Iterable
from dataclasses import replace

from core.alarms.alarm import Alarm, AlarmChange, AlarmEvent, AlarmRule, changed
from core.limits import INACTIVE, LEVELS, ON, AlarmLevel, DelayTimer, Judgement
from core.units import NS_PER_S

Timers = tuple[DelayTimer, DelayTimer]

SAME_EVENT_NS = 3600 * NS_PER_S
"""Time within which a further direction belongs to an unacknowledged occurrence. A sudden change of
a film passes its limit in x and in y within the hour over which a change must last."""


def update(
    alarm: Alarm, condition: Judgement, now_ns: int, rule: AlarmRule
) -> tuple[Alarm, tuple[AlarmEvent, ...]]:
    """Update an alarm with the judgement at the time `now_ns`; return it and its new events.

    While the condition is unknown, the level does not change and the delays are paused. Level,
    value, limit and directions of an unknown condition are the last known ones. A direction that
    exceeds the limit later belongs to an unacknowledged occurrence for `SAME_EVENT_NS`; after an
    acknowledgement or that time, it starts a new occurrence.
    """
    events: list[AlarmEvent] = []

    def note(after: Alarm, change: AlarmChange, reason: str) -> Alarm:
        after, event = changed(alarm, after, change, now_ns, reason=reason)
        events.append(event)
        return after

    last, n_before, why = alarm.condition, alarm.occurrence, condition.suppressed_by
    if why is not None and why != alarm.suppressed_by:
        after = replace(alarm, suppressed_by=why)
        alarm = after if alarm.suppressed_by else note(after, AlarmChange.SUPPRESSED, why)
    if not condition.is_known:
        kept = {name: getattr(last, name) for name in ("level", "value", "limit", "directions")}
        condition = replace(condition, **kept)
    if condition != last:
        is_shown = alarm.level is not None and alarm.suppressed_by is None
        known, lost = AlarmChange.CONDITION_KNOWN, AlarmChange.CONDITION_UNKNOWN
        after = replace(alarm, condition=condition)
        if is_shown and condition.is_known != last.is_known:
            after = note(after, known if condition.is_known else lost, condition.reason)
        alarm = after

    timers = _stepped(alarm, now_ns, rule)
    before, now, held = standing_level(alarm.timers), standing_level(timers), alarm.level
    if timers != alarm.timers:
        alarm = replace(alarm, timers=timers)
    joins = bool(set(condition.directions) - set(last.directions))
    joins &= alarm.is_acknowledged or now_ns - (alarm.raised_ns or now_ns) > SAME_EVENT_NS
    if now is not None and now > (before or 0) and (alarm.is_latched or now > (held or 0)):
        rises = held is not None and not alarm.is_latched
        change = AlarmChange.ESCALATED if rises else AlarmChange.RAISED
        alarm = note(_raised(alarm, now, now_ns), change, condition.reason)
    elif now != held and not alarm.is_latched:
        if rule.is_latching:
            alarm = note(replace(alarm, is_latched=True), AlarmChange.LATCHED, condition.reason)
        else:
            change = AlarmChange.RETURNED if now is None else AlarmChange.EASED
            alarm = note(replace(alarm, level=now), change, condition.reason)
    if joins and now is not None and alarm.occurrence == n_before:
        alarm = note(_raised(alarm, now, now_ns), AlarmChange.RAISED, condition.reason)

    if why is None and alarm.suppressed_by is not None:
        shown = shown_again(replace(alarm, suppressed_by=None))
        alarm = note(shown, AlarmChange.UNSUPPRESSED, alarm.suppressed_by)
    return alarm, tuple(events)


def interrupted(alarm: Alarm) -> Alarm:
    """Return the alarm with paused delay timers, for a gap in the samples."""
    return replace(alarm, timers=_paused(alarm.timers))


def shown_again(alarm: Alarm) -> Alarm:
    """Return an alarm that is no longer hidden; if active, it is unacknowledged (state B)."""
    return replace(alarm, is_acknowledged=alarm.is_acknowledged and alarm.level is None)


def restored(alarm: Alarm) -> Alarm:
    """Return the alarm after a restart: an active alarm stays active, pending delays are reset."""
    level = None if alarm.is_latched else alarm.level
    alert, danger = (ON if (level or 0) >= each else INACTIVE for each in LEVELS)
    return replace(alarm, timers=(alert, danger))


def next_level(held: AlarmLevel | None, timers: Iterable[Timers]) -> AlarmLevel | None:
    """Return the level that an alarm will reach if its present conditions outlast all delays.

    `held` is the present level, which is returned if no delay is running. `timers` are the pairs of
    delay timers (alert, danger) of the alarm, or of each direction of a film.
    """
    pairs = [pair for each in timers for pair in zip(LEVELS, each, strict=True)]
    pending = [(level, timer.is_on) for level, timer in pairs if timer not in (INACTIVE, ON)]
    rising = max((level for level, is_on in pending if not is_on), default=None)
    if rising is not None and rising > (held or 0):
        return rising
    if not any(is_on for _, is_on in pending):
        return held
    return max((level for level, timer in pairs if timer == ON), default=None)


def standing_level(timers: Timers) -> AlarmLevel | None:
    """Return the highest level whose on-delay has elapsed, or None; the latch is disregarded."""
    return max((n for n, t in zip(LEVELS, timers, strict=True) if t.is_on), default=None)


def _raised(alarm: Alarm, level: AlarmLevel, now_ns: int) -> Alarm:
    """Return the alarm with a new, unacknowledged occurrence."""
    held = alarm.level
    return replace(
        alarm,
        level=max(level, held or level),
        occurrence=alarm.occurrence + 1,
        is_acknowledged=False,
        raised_ns=now_ns,
        raised_at=alarm.condition.point,
        is_latched=held is not None and held > level,
    )


def _stepped(alarm: Alarm, now_ns: int, rule: AlarmRule) -> Timers:
    if not alarm.condition.is_known:
        return _paused(alarm.timers)
    level = alarm.condition.level or 0
    alert, danger = (
        timer.step(level >= each, now_ns, rule.on_delay_ns, rule.off_delay_ns)
        for each, timer in zip(LEVELS, alarm.timers, strict=True)
    )
    return alert, danger


def _paused(timers: Timers) -> Timers:
    alert, danger = timers
    return alert.paused(), danger.paused()
