"""What is old goes in small pieces, by a loop; ages count from what a day of results proves."""

import sqlite3
from collections.abc import Callable, Sequence

import pytest
from pydantic import ValidationError
from rigs.assessments import assessment
from rigs.old_results import (
    HOUR_NS,
    KEEP_NOTHING,
    NOW_NS,
    SECOND_NS,
    T0,
    TIERS,
    asked,
    delete_all,
    require_same_hours,
    series_of,
)
from rigs.rolled_trends import gather_all, n_rows
from rigs.tiers import covering
from structlog.testing import capture_logs

from acquisition.clock import Clock
from core.units import DAY_NS
from service.settings.storage import RetentionSettings
from service.store import retention as deleting
from service.store.loops import LOOK_S, RETENTION_PERIOD_S, RETENTION_REST_SHARE, RetentionLoop
from service.store.port import StoreError
from service.store.retention import Ages, ages_of
from service.store.store import Store


def test_what_is_young_stays_as_it_was(rolled, path):
    keep = {"readings_days": 5 * HOUR_NS}

    delete_all(rolled, keep)

    assert n_rows(path, "assessment", f"time_ns < {T0 + 4 * HOUR_NS}") == 0
    young = asked(start_ns=T0 + 4 * HOUR_NS, max_points=5000)
    assert rolled.trend(young).bucket_ns is None


def test_without_limits_nothing_is_deleted(rolled, path):
    before = path.read_bytes()
    delete_all(rolled, {})
    assert path.read_bytes() == before


def test_what_is_not_rolled_up_is_not_deleted(plain, tmp_path):
    n_before = n_rows(tmp_path / "plain.sqlite3", "assessment")
    delete_all(plain)
    assert n_rows(tmp_path / "plain.sqlite3", "assessment") == n_before


DAMAGES = [
    "DELETE FROM rollup_numbers WHERE {where}",
    "DELETE FROM rollup_cell WHERE {where}",
    "UPDATE rollup_cell SET n_readings = n_readings + 1 WHERE {where}",
]


@pytest.mark.parametrize(("width_s", "damage"), covering([60, 600, 3600], DAMAGES))
def test_what_is_rolled_up_wrongly_is_gathered_anew_before_it_is_deleted(
    rolled, plain, path, execute, width_s, damage
):
    hour_ns = T0 + 2 * HOUR_NS
    where = f"width_s = {width_s} AND start_ns >= {hour_ns} AND start_ns < {hour_ns + HOUR_NS}"
    execute(damage.format(where=where))

    delete_all(rolled)
    assert n_rows(path, "assessment", f"time_ns < {hour_ns}") == 0
    assert n_rows(path, "assessment", f"time_ns < {hour_ns + HOUR_NS}") > 30
    gather_all(rolled)
    delete_all(rolled)

    assert n_rows(path, "assessment", f"time_ns < {NOW_NS - HOUR_NS}") == 0
    for minutes in (2, 10, 60):
        require_same_hours(rolled.trend(asked(minutes)), plain.trend(asked(minutes)))


def test_a_roll_up_that_is_damaged_when_nothing_finer_is_left_is_told(rolled, path, execute):
    delete_all(rolled, TIERS[0][0])
    assert rolled.retention.trouble is None
    n_before = n_rows(path, "rollup_cell", "width_s = 60")
    execute(
        "UPDATE rollup_cell SET n_readings = n_readings + 1 WHERE width_s = 60"
        " AND start_ns = (SELECT min(start_ns) FROM rollup_cell WHERE width_s = 60)"
    )
    delete_all(rolled, TIERS[1][0])

    assert n_rows(path, "rollup_cell", "width_s = 60") == n_before
    assert rolled.retention.trouble is not None
    assert "roll-ups with series id 1 are damaged" in rolled.retention.trouble


def test_deleting_twice_changes_nothing(rolled, path):
    limits = TIERS[1][0]
    delete_all(rolled, limits)
    once = [n_rows(path, t) for t in ("assessment", "rollup_cell", "rollup_numbers")]

    assert not any(rolled.retention.delete(series, limits, NOW_NS) for series in series_of(rolled))
    assert [n_rows(path, t) for t in ("assessment", "rollup_cell", "rollup_numbers")] == once


def test_each_piece_of_work_is_small(rolled, path, monkeypatch):
    monkeypatch.setattr(deleting, "MAX_READINGS", 150)
    (series,) = series_of(rolled)
    before = n_rows(path, "assessment")
    while rolled.retention.delete(series, KEEP_NOTHING, NOW_NS):
        after = n_rows(path, "assessment")
        assert 0 < before - after <= 200
        before = after
    assert n_rows(path, "assessment", f"time_ns < {NOW_NS - HOUR_NS}") == 0


LETTER = (
    "INSERT INTO outbox (receiver, event_id, alarm, number, body, queued_ns, is_urgent,"
    " is_active, state, done_ns) VALUES ('shift', ?, ?, ?, '{}', 0, 0, 1, ?, ?)"
)
EVENT = (
    "INSERT INTO alarm_event (alarm, number, unit, subject, kind, change, state_before,"
    " state_after, time_ns, occurrence, actor, reason) VALUES"
    " ('probe', ?, 'U1', '', 'channel_not_ok', 'raised', 'a', 'b', ?, 1, '', '')"
)


def test_messages_that_are_done_are_deleted_but_for_the_last_of_an_alarm(path, rolled, execute):
    rows = [("raised", 1, "delivered"), ("raised", 2, "delivered"), ("raised", 3, "waiting")]
    rows += [("other", 1, "refused")]
    for alarm, number, state in rows:
        done_ns = None if state == "waiting" else T0
        execute(LETTER, (f"{alarm}{number}", alarm, number, state, done_ns))
    limits = {"messages_days": HOUR_NS}

    rolled.retention.prune(limits, T0 + HOUR_NS)
    assert n_rows(path, "outbox") == 4
    rolled.retention.prune(limits, T0 + HOUR_NS + 1)

    assert n_rows(path, "outbox", "alarm = 'raised' AND number = 1") == 0
    assert n_rows(path, "outbox") == 3
    with pytest.raises(sqlite3.IntegrityError):
        execute("DELETE FROM outbox WHERE state = 'waiting'")


def test_a_recent_message_stays_whatever_the_clock_said_then(path, rolled, execute):
    for number, event_ns in ((1, T0 - 2 * HOUR_NS), (2, T0), (3, T0)):
        execute(EVENT, (number, event_ns))
        execute(LETTER, (f"probe{number}", "probe", number, "delivered", 0))

    rolled.retention.prune({"messages_days": HOUR_NS}, T0 + 1)

    assert n_rows(path, "outbox", "number = 1") == 0
    assert n_rows(path, "outbox") == 2


YEAR_NS = 365 * DAY_NS


def measure(store: Store, times_ns: Sequence[int], bearing: str = "UJB") -> None:
    """Results of these times, gathered; and one more, so that the last hour is complete."""
    all_ns = [*times_ns, times_ns[-1] + HOUR_NS]
    store.append([assessment(at, bearing=bearing, speed_rpm=90.0) for at in all_ns], [])
    gather_all(store)


def hours(first: int, n: int) -> list[int]:
    """A result in each of some hours."""
    return [T0 + hour * HOUR_NS + SECOND_NS for hour in range(first, first + n)]


def n_single(store: Store) -> int:
    """How many single results there are."""
    wide = asked(start_ns=0, end_ns=1 << 61, is_page=True, max_points=1000)
    return len(store.trend(wide).time_ns)


def test_where_there_is_no_day_of_results_there_is_nothing_to_count_from(store):
    assert store.retention.believed_ns() is None
    measure(store, hours(0, 22))
    # more in an hour that has some is no more time, nor is the same hour of another bearing
    measure(store, [T0 + 60 * SECOND_NS, T0 + 90 * SECOND_NS])
    measure(store, hours(50, 20), "LJB")
    assert store.retention.believed_ns() is None
    measure(store, [hours(30, 1)[0] + SECOND_NS])

    assert store.retention.believed_ns() == T0


async def test_a_clock_a_year_ahead_makes_results_old_after_a_day_of_them(store, stepped_clock):
    limits = {"readings_days": 30 * DAY_NS}
    measure(store, hours(0, 48))
    step_s = (T0 + 2 * YEAR_NS - stepped_clock.now_ns()) / SECOND_NS
    stepped_clock.step(step_s)  # type: ignore[attr-defined]
    ahead = [at + YEAR_NS for at in hours(48, 24)]
    measure(store, ahead[:1])
    await RetentionLoop(store.retention, limits, stepped_clock).round()
    assert n_single(store) == 51
    measure(store, ahead[1:])
    await RetentionLoop(store.retention, limits, stepped_clock).round()

    assert n_single(store) == 25


LIMITS = {"readings_days": DAY_NS}


class OldStore:
    """Two bearings with some work each, which takes a second a piece."""

    def __init__(self, clock: Clock, step: Callable[[float], None]) -> None:
        self._clock, self._step = clock, step
        self.left = {1: 3, 2: 1}
        self.done: list[int] = []
        self.refusal: str | None = None
        self.held_up: str | None = None
        self.believed: int | None = clock.now_ns()
        self.asked_ns: int | None = None

    @property
    def trouble(self) -> str | None:
        return self.held_up

    def believed_ns(self) -> int | None:
        return self.believed

    def series(self) -> Sequence[int]:
        return list(self.left)

    def delete(self, series: int, limits: Ages, now_ns: int) -> bool:
        assert (limits, now_ns <= self._clock.now_ns()) == (LIMITS, True)
        if self.refusal:
            raise StoreError(self.refusal)
        self.asked_ns = now_ns
        self._step(1.0)
        self.left[series] -= 1
        self.done.append(series)
        return self.left[series] >= 0

    def prune(self, *_: object) -> bool:
        return False

    def give_back(self) -> bool:
        return False


@pytest.fixture
def old(stepped_clock: Clock) -> OldStore:
    return OldStore(stepped_clock, stepped_clock.step)  # type: ignore[attr-defined]


@pytest.fixture
def retaining(old: OldStore, stepped_clock: Clock) -> RetentionLoop:
    return RetentionLoop(old, LIMITS, stepped_clock)


async def test_bearings_take_turns_until_nothing_is_old(old, retaining):
    assert [await retaining.round() for _ in range(4)] == [True, True, True, False]
    assert old.done == [1, 2] * 4


async def test_it_rests_longer_than_it_works(retaining, stepped_clock):
    begun_s = stepped_clock.monotonic_s()
    await retaining.round()

    lasted_s = stepped_clock.monotonic_s() - begun_s
    assert lasted_s == pytest.approx(2.0 * (1.0 + RETENTION_REST_SHARE))
    assert LOOK_S < RETENTION_PERIOD_S


async def test_a_store_that_fails_is_asked_again(old, retaining):
    old.refusal = "disk full"
    assert not await retaining.round()
    old.refusal = None
    assert await retaining.round()


async def test_what_cannot_be_deleted_is_told_once(old, retaining):
    old.held_up = "roll-ups are damaged"
    with capture_logs() as lines:
        for _ in range(3):
            await retaining.round()

    assert [line["event"] for line in lines] == ["some old data cannot be deleted"]


async def test_a_clock_that_is_years_ahead_or_less_than_a_day_of_results_makes_nothing_old(
    old, retaining, stepped_clock
):
    stepped_clock.step(20.0 * 365.0 * 86_400.0)  # type: ignore[attr-defined]
    await retaining.round()
    assert old.asked_ns == old.believed
    old.believed, old.done = None, []
    assert not await retaining.round()
    assert old.done == []


def test_nothing_finer_is_kept_longer_than_what_is_coarser_and_zero_days_are_for_ever():
    for wrong in (
        {"readings_days": 10.0, "minutes_days": 9.0},
        {"readings_days": 0.0, "minutes_days": 9.0},
        {"minutes_days": 500.0, "ten_minutes_days": 499.0},
    ):
        with pytest.raises(ValidationError, match="must be"):
            RetentionSettings.model_validate(wrong)
    everything = dict.fromkeys(("readings_days", "minutes_days", "ten_minutes_days"), 0.0)
    RetentionSettings.model_validate(everything)
    found = ages_of(RetentionSettings(readings_days=1.5, films_days=0.0))
    assert (found["readings_days"], found.get("films_days")) == (round(1.5 * DAY_NS), None)
