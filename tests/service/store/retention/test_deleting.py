"""What is old goes in small pieces, and nothing goes that is not kept wider."""

import sqlite3
from pathlib import Path

import pytest
from rigs.old_results import (
    HOUR_NS,
    KEEP_NOTHING,
    NOW_NS,
    T0,
    TIERS,
    asked,
    delete_all,
    require_same_hours,
    series_of,
)
from rigs.rolled_trends import gather_all, n_rows
from rigs.store_fixtures import Execute
from rigs.tiers import covering

from service.store import retention as deleting
from service.store.sqlite import SqliteStore


def test_what_is_young_stays_as_it_was(rolled: SqliteStore, path: Path) -> None:
    keep = {"readings_days": 5 * HOUR_NS}

    delete_all(rolled, keep)

    assert n_rows(path, "assessment", f"time_ns < {T0 + 4 * HOUR_NS}") == 0
    young = asked(start_ns=T0 + 4 * HOUR_NS, max_points=5000)
    assert rolled.trend(young).bucket_ns is None


def test_without_limits_nothing_is_deleted(rolled: SqliteStore, path: Path) -> None:
    before = path.read_bytes()
    delete_all(rolled, {})
    assert path.read_bytes() == before


def test_what_is_not_rolled_up_is_not_deleted(plain: SqliteStore, tmp_path: Path) -> None:
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
    rolled: SqliteStore, plain: SqliteStore, path: Path, execute: Execute, width_s: int, damage: str
) -> None:
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


def test_a_roll_up_that_is_damaged_when_nothing_finer_is_left_is_told(
    rolled: SqliteStore, path: Path, execute: Execute
) -> None:
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
    assert "roll-ups of bearing 1 are damaged" in rolled.retention.trouble


def test_deleting_twice_changes_nothing(rolled: SqliteStore, path: Path) -> None:
    limits = TIERS[1][0]
    delete_all(rolled, limits)
    once = [n_rows(path, t) for t in ("assessment", "rollup_cell", "rollup_numbers")]

    assert not any(rolled.retention.delete(series, limits, NOW_NS) for series in series_of(rolled))
    assert [n_rows(path, t) for t in ("assessment", "rollup_cell", "rollup_numbers")] == once


def test_each_piece_of_work_is_small(
    rolled: SqliteStore, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_messages_that_are_done_are_deleted_but_for_the_last_of_an_alarm(
    path: Path, rolled: SqliteStore, execute: Execute
) -> None:
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


def test_a_message_of_what_happened_lately_stays_whatever_the_clock_said_then(
    path: Path, rolled: SqliteStore, execute: Execute
) -> None:
    for number, event_ns in ((1, T0 - 2 * HOUR_NS), (2, T0), (3, T0)):
        execute(EVENT, (number, event_ns))
        execute(LETTER, (f"probe{number}", "probe", number, "delivered", 0))

    rolled.retention.prune({"messages_days": HOUR_NS}, T0 + 1)

    assert n_rows(path, "outbox", "number = 1") == 0
    assert n_rows(path, "outbox") == 2
