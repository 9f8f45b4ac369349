"""Damage that nobody meets is found by looking at every row in turn."""

import asyncio
from contextlib import closing, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rigs.assessments import assessment
from rigs.store_fixtures import Execute, at

from service.live.live_view import LiveView
from service.measuring.integrity import IntegrityMonitor
from service.runtime.heartbeats import PATIENCE_S, Heartbeats
from service.runtime.periodic import LOOK_S
from service.store.access.identities import Role, Session
from service.store.audit import AuditQuery
from service.store.loops import ScrubLoop
from service.store.seals import Place
from service.store.sqlite import SqliteStore
from service.store.sqlite import checking as scrubbing
from service.store.sqlite.checking import findings

N = 40


@pytest.fixture(autouse=True)
def _few_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scrubbing, "ROWS_AT_ONCE", 7)


@pytest.fixture(autouse=True)
def _filled(path: Path) -> None:
    with closing(SqliteStore(path)) as store:
        store.append([assessment(at(n), speed_rpm=float(n)) for n in range(N)], [])


def once_around(store: SqliteStore) -> int:
    """How many looks it takes."""
    n_looks = 1
    while not store.integrity.check_some():
        n_looks += 1
    return n_looks


def test_altered_and_missing_rows_are_found_and_are_those_that_the_command_finds(
    path: Path, execute: Execute
) -> None:
    execute("UPDATE assessment SET coverage = 0.5 WHERE time_ns = ?", (at(20),))
    execute("DELETE FROM assessment WHERE time_ns = ?", (at(33),))
    execute("UPDATE series SET bearing = 'LJB'")
    with closing(SqliteStore(path)) as store:
        once_around(store)
        found = store.integrity.damaged

    assert set(found) == {
        Place("assessment", f"series 1, time_ns {at(20)}"),
        Place("assessment", f"series 1, time_ns {at(33)}", is_missing=True),
        Place("series", "id 1"),
    }
    assert {f"{place.table}: {place.key}" for place in found} == {
        finding.detail for finding in findings(path)
    }


def test_of_what_is_whole_nothing_is_said_however_often_it_is_looked_at(path: Path) -> None:
    with closing(SqliteStore(path)) as store:
        assert once_around(store) == once_around(store) > 2 * N / 7
        assert store.integrity.n_damaged == 0


def test_after_a_restart_it_goes_on_where_it_was_also_among_keys_of_bytes(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scrubbing, "REMEMBER_EVERY", 1)
    with closing(SqliteStore(path)) as store:
        store.access.accounts.add("anna", Role.ADMIN, "hash", 1)
        for n in (0x80, 0xFF):
            assert store.access.sessions.add(Session(bytes([n]) * 32, "anna", 2, 3), 1, 0)
    monkeypatch.setattr(scrubbing, "ROWS_AT_ONCE", 1)
    with closing(SqliteStore(path)) as store:
        n_looks = once_around(store)

    n_with_restarts, is_around = 0, False
    while not is_around:
        with closing(SqliteStore(path)) as store:
            is_around = store.integrity.check_some()
        n_with_restarts += 1
    assert n_with_restarts == n_looks


@pytest.mark.parametrize(
    "place",
    [
        *("nonsense", "[1]", '["gone", false, null]', '["gap", true, [{}]]'),
        *('["session", false, [{"hex": 1}]]', '["session", false, [{"hex": "f"}]]'),
    ],
)
def test_a_damaged_place_makes_it_begin_anew(path: Path, place: str, execute: Execute) -> None:
    with closing(SqliteStore(path)) as store:
        n_looks = once_around(store)
    execute(f"UPDATE seal_walk SET place = '{place}'")  # noqa: S608
    with closing(SqliteStore(path)) as store:
        assert once_around(store) == n_looks


def test_keys_that_are_no_text_stop_nothing(path: Path, execute: Execute) -> None:
    with closing(SqliteStore(path)) as store:
        for name in ("a", "b"):
            with store.database.writing() as writer:
                writer.execute(
                    "INSERT INTO shaft_response (unit, created_ns, document) VALUES (?, 1, '')",
                    (name,),
                )
    execute("UPDATE shaft_response SET unit = CAST(x'ff80' AS TEXT) WHERE unit = 'b'")
    with closing(SqliteStore(path)) as store:
        once_around(store)
        assert {place.table for place in store.integrity.damaged} == {"shaft_response"}


async def test_what_it_finds_is_told_in_the_audit_trail_and_makes_the_alarm(
    path: Path, stepped_clock: Any, execute: Execute
) -> None:
    execute(f"DELETE FROM assessment WHERE time_ns = {at(3)}")  # noqa: S608
    with closing(SqliteStore(path)) as store:
        soundness = IntegrityMonitor(store, stepped_clock, LiveView([], stepped_clock, 30.0))
        loop = ScrubLoop(store.integrity, stepped_clock)
        while not await loop.look():
            pass
        await soundness.look()
        (told,) = store.audit.entries(AuditQuery(action="store.row_damaged"))

    assert soundness.trouble is not None
    assert told.reason == "the row is missing"


async def test_a_disk_that_stands_still_makes_the_loop_rest_but_not_fall_silent(
    stepped_clock: Any,
) -> None:
    beats = Heartbeats(stepped_clock)
    slow_disk: Any = SimpleNamespace(check_some=lambda: stepped_clock.step(30.0))
    loop = ScrubLoop(slow_disk, stepped_clock)
    slept_s = []

    async def sleep(duration_s: float) -> None:
        slept_s.append(duration_s)
        stepped_clock.step(duration_s)
        assert not beats.troubles
        if len(slept_s) == 20:
            raise asyncio.CancelledError

    stepped_clock.sleep = sleep
    with suppress(asyncio.CancelledError):
        await beats.tend("scrub", loop.run)

    assert max(slept_s) <= LOOK_S
    assert sum(slept_s) > PATIENCE_S
