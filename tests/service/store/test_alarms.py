"""Alarms on the disk: as they are, with all that has ever happened to them."""

from dataclasses import replace
from itertools import count

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rigs.store_fixtures import gap

from core.alarms.alarm import Alarm, AlarmEvent, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.life_cycle import update
from core.alarms.operation import Acknowledge, Shelve, TakeOutOfService, operate
from core.condition.cells import OperatingPoint
from core.condition.operating_state import OperatingState
from core.limits import INACTIVE, AlarmLevel, Judgement, unknown
from service.store.port import AlarmQuery, StoreError, ValueRange

T0 = 1_767_225_600_000_000_000
FULL, PART = OperatingState.FULL_LOAD, OperatingState.PART_LOAD
POINT = OperatingPoint(FULL, 0.37, -12.5, 46.2)
ALERT = Judgement(AlarmLevel.ALERT, value=160.25, limit=150.0, reason="above_limit", point=POINT)


def identity(subject: str = "UJB", unit: str = "U1") -> AlarmIdentity:
    return AlarmIdentity(unit, subject, "order1_shaft_x")


def raised(n_ns: int = T0, subject: str = "UJB", unit: str = "U1") -> AlarmNews:
    alarm, events = update(Alarm(identity(subject, unit)), ALERT, n_ns, AlarmRule())
    return AlarmNews(alarm, events)


def then(news: AlarmNews, condition: Judgement, now_ns: int) -> AlarmNews:
    return AlarmNews(*update(news.alarm, condition, now_ns, AlarmRule()))


def as_stored(alarm: Alarm) -> Alarm:
    """All of an alarm but its timers, which a restart forgets."""
    condition = replace(alarm.condition, suppressed_by=alarm.suppressed_by, point=None)
    return replace(alarm, condition=condition, timers=(INACTIVE, INACTIVE))


ACTIONS = [
    lambda alarm: Acknowledge("A. Name", alarm.occurrence, "seen, Ünïcode 'quoted'"),
    lambda _: Shelve("B. Name", "cable", T0 + 10**12),
    lambda _: TakeOutOfService("C. Name", "overhaul"),
]

LIFE = st.lists(
    st.sampled_from(
        [
            ALERT,
            Judgement(AlarmLevel.DANGER, value=250.0, limit=200.0, point=OperatingPoint()),
            Judgement(value=3.0),
            unknown("sensor_failure"),
            unknown("standstill", "standstill"),
            *ACTIONS,
        ]
    ),
    min_size=1,
    max_size=12,
)


def test_an_alarm_and_its_events_are_read_as_they_were_written(store):
    numbers = count()

    @given(steps=LIFE)
    @settings(max_examples=40, deadline=None)
    def check(steps: list[object]) -> None:
        alarm, told = Alarm(identity(f"bearing {next(numbers)}")), list[AlarmEvent]()
        for number, step in enumerate(steps):
            if isinstance(step, Judgement):
                alarm, events = update(alarm, step, T0 + number, AlarmRule())
            else:
                alarm, events = operate(alarm, step(alarm), T0 + number)
            if events:
                store.append([], [], [AlarmNews(alarm, events)])
                told += events
                (kept,) = (one for one in store.alarms() if one.identity == alarm.identity)
                assert kept == as_stored(alarm)
        found = store.alarm_events(AlarmQuery(alarm=alarm.identity.id, limit=1000))
        assert [stored.event for stored in found] == told[::-1]

    check()


def test_news_that_is_written_twice_counts_once_and_never_undoes_what_came_later(store):
    first = raised()
    second = then(first, Judgement(), T0 + 5)

    store.append([], [], [first])
    store.append([], [], [first, second])
    store.append([], [], [first])

    assert store.alarms() == [as_stored(second.alarm)]
    assert [s.event.number for s in store.alarm_events(AlarmQuery())] == [2, 1]


def test_news_of_alarms_stands_or_falls_with_the_gap_it_came_with(store, execute):
    with pytest.raises(StoreError, match="NOT NULL"):
        store.append([], [gap(unit=None)], [raised()])
    assert store.alarms() == []

    execute("CREATE TRIGGER no BEFORE INSERT ON alarm BEGIN SELECT RAISE(ABORT, 'no'); END;")
    with pytest.raises(StoreError, match="no"):
        store.append([], [gap()], [raised()])
    assert store.gaps("U1", 0, 2**62) == []
    assert store.alarm_events(AlarmQuery()) == []


def test_events_are_found_by_alarm_unit_kind_and_time_page_by_page(store):
    store.append([], [], [raised(T0 + n, "UJB" if n % 2 else "LJB", f"U{n}") for n in range(10)])

    def found(**wanted: object) -> list[str]:
        events = store.alarm_events(AlarmQuery(**wanted))  # type: ignore[arg-type]
        return [stored.event.identity.id for stored in events]

    assert found(unit="U3") == ["U3:UJB:order1_shaft_x"]
    assert found(alarm="U4:LJB:order1_shaft_x") == ["U4:LJB:order1_shaft_x"]
    assert found(kind="link_lost") == []
    assert len(found(kind="order1_shaft_x")) == 10
    assert len(found(start_ns=T0 + 2, end_ns=T0 + 5)) == 3
    pages, before = [], 2**63 - 1
    while page := store.alarm_events(AlarmQuery(before=before, limit=4)):
        pages.append([stored.event.time_ns - T0 for stored in page])
        before = page[-1].id
    assert pages == [[9, 8, 7, 6], [5, 4, 3, 2], [1, 0]]


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        ({}, "ABCDE"),
        ({"states": (FULL,)}, "AB"),
        ({"states": (FULL, PART)}, "ABC"),
        ({"eccentricity_ratio": ValueRange(0.35, 0.4)}, "AC"),
        ({"oil_temperature_c": ValueRange(high=46.2)}, "AB"),
        ({"attitude_deg": ValueRange(low=0.0)}, "BC"),
        ({"states": (FULL,), "attitude_deg": ValueRange(high=0.0)}, "A"),
    ],
)
def test_events_are_found_by_the_condition_at_raising(store, wanted, found):
    others = (OperatingPoint(FULL, 0.5, 10.0, 40.0), OperatingPoint(PART, 0.38, 20.0, 48.0))
    points = dict(zip("ABCDE", (POINT, *others, OperatingPoint(), None), strict=True))
    for subject, point in points.items():
        first = AlarmNews(
            *update(Alarm(identity(subject)), replace(ALERT, point=point), T0, AlarmRule())
        )
        store.append([], [], [first, then(first, Judgement(), T0 + 5)])

    events = [s.event for s in store.alarm_events(AlarmQuery(**wanted))]  # type: ignore[arg-type]

    assert {event.identity.subject for event in events} == set(found)
    assert len(events) == 2 * len(found)
    assert all(event.raised_at == points[event.identity.subject] for event in events)
