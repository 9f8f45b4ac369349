"""Alarm rates, chattering, fleeting and stale alarms, counted from events."""

from collections.abc import Sequence

import pytest

from core.alarms.alarm import Alarm, AlarmChange, AlarmEvent, AlarmIdentity, AlarmState, Hold
from core.alarms.statistics import ChatterRule, ChatterWatch, figures_of, stale_alarms
from core.limits import AlarmLevel
from core.units import NS_PER_S

RULE = ChatterRule()
DAY_S = 86_400
NORMAL, UNSEEN = AlarmState.NORMAL, AlarmState.UNACKNOWLEDGED
ALERT, DANGER = AlarmLevel


def event(
    at_s: float,
    change: AlarmChange = AlarmChange.RAISED,
    subject: str = "UJB",
    level: AlarmLevel = ALERT,
    before: AlarmState = NORMAL,
    after: AlarmState = UNSEEN,
) -> AlarmEvent:
    identity = AlarmIdentity("U1", subject, "order1_shaft_x")
    return AlarmEvent(identity, 1, change, level, before, after, round(at_s * NS_PER_S), 1)


def figures(events: Sequence[AlarmEvent], span_s: float = DAY_S):  # type: ignore[no-untyped-def]
    return figures_of(events, 0, round(span_s * NS_PER_S), RULE)


def test_what_calls_for_somebody_is_counted_and_nothing_else():
    shelved = AlarmState.SHELVED
    events = [
        event(1.0),
        event(2.0, AlarmChange.ESCALATED, level=DANGER, before=UNSEEN),
        event(3.0, AlarmChange.ACKNOWLEDGED, before=UNSEEN, after=AlarmState.ACKNOWLEDGED),
        event(4.0, AlarmChange.SHELVED, before=AlarmState.ACKNOWLEDGED, after=shelved),
        event(5.0, AlarmChange.ESCALATED, before=shelved, after=shelved),  # nobody is told
        event(6.0, AlarmChange.UNSHELVED, before=shelved),
        event(7.0, AlarmChange.RETURNED, after=AlarmState.RETURNED_UNACKNOWLEDGED),
        event(8.0, AlarmChange.COMMENTED, before=UNSEEN),
    ]
    found = figures(events)

    assert (found.n_alarms, found.per_day) == (3, pytest.approx(3.0))
    assert found.per_10_min == pytest.approx(3 / 144)
    assert found.n_by_level == {ALERT: 2, DANGER: 1}


def test_the_worst_ten_minutes_and_the_most_frequent_alarms_are_found():
    found = figures([event(t) for t in (595.0, 600.0, 1000.0, 1194.9, 1195.0, 5000.0)])

    assert found.most_in_10_min == 4
    assert found.share_in_flood == 0.0
    flood, none = (figures([event(600.0 + i) for i in range(n)]) for n in (11, 10))
    assert (flood.share_in_flood, none.share_in_flood) == (pytest.approx(1 / 144), 0.0)

    found = figures([event(n, subject=s) for n, s in enumerate("AABACA")])

    assert [(f.alarm, f.n_alarms) for f in found.most_frequent] == [
        *(("U1:A:order1_shaft_x", 4), ("U1:B:order1_shaft_x", 1), ("U1:C:order1_shaft_x", 1)),
    ]
    assert found.most_frequent[0].share == pytest.approx(4 / 6)


@pytest.mark.parametrize(
    ("times_s", "n_chattering"),
    [((0, 30, 60), 3), ((0, 30, 61), 0), ((0, 50, 100, 110, 120), 4), ((0, 1), 0)],
)
def test_three_in_a_minute_chatter(times_s, n_chattering):
    found = figures([event(t) for t in times_s])
    watch = ChatterWatch(RULE)
    for each in (event(t) for t in times_s):
        watch.note(each, each.time_ns)

    assert sum(found.chattering.values()) == n_chattering
    chattering = {"U1:UJB:order1_shaft_x"} if n_chattering else set()
    assert watch.chattering(130 * NS_PER_S) == chattering


def test_an_alarm_that_returns_soon_is_fleeting_and_does_not_chatter_for_long():
    watch = ChatterWatch(RULE)
    for at_s in (0, 1, 2):
        watch.note(event(at_s), at_s * NS_PER_S)

    assert watch.chattering(602 * NS_PER_S) == {"U1:UJB:order1_shaft_x"}
    assert not watch.chattering(603 * NS_PER_S)

    back = AlarmChange.RETURNED
    events = [event(0), event(59.9, back), event(100), event(160, back)]

    assert figures(events).n_fleeting == 1


def test_what_is_active_for_more_than_a_day_is_stale_unless_hidden():
    def alarm(subject: str, **other: object) -> Alarm:
        identity = AlarmIdentity("U1", subject, "order1_shaft_x")
        return Alarm(identity, **{"level": ALERT, "raised_ns": 0, **other})  # type: ignore[arg-type]

    alarms = [
        alarm("young", raised_ns=2 * NS_PER_S),
        alarm("old", raised_ns=1),
        alarm("oldest"),
        alarm("gone", level=None),
        alarm("shelved", shelf=Hold("A. Name", "known", 0)),
    ]
    found = stale_alarms(alarms, DAY_S * NS_PER_S + 2)

    assert [each.identity.subject for each in found] == ["oldest", "old"]


def test_spans_without_length_are_refused():
    with pytest.raises(ValueError, match="must be after"):
        figures([], 0.0)
