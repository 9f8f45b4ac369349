"""Damage to what is stored is told while the service runs: alarm, audit trail, readiness."""

import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from core.limits import AlarmLevel
from core.monitor.assessment import Assessment
from service.measuring.integrity import LOOK_EVERY_S, IntegrityMonitor
from service.measuring.live_view import LiveView
from service.measuring.metrics import add_integrity
from service.measuring.service_alarms import ServiceAlarms, ServiceHealth
from service.runtime.metrics import Families
from service.store.audit import AuditQuery
from service.store.port import StoreError, TrendQuery
from service.store.sqlite import SqliteStore

Build = Callable[..., Assessment]
T0 = 1_767_225_600_000_000_000
EVERYTHING = TrendQuery("U1", "UJB", ("speed_rpm",), 0, 2**62, 5000, 2**62)


@pytest.fixture
def path(tmp_path: Path, assessment: Build) -> Path:
    """A database with three results."""
    made = tmp_path / "data" / "padwatch.sqlite3"
    with closing(SqliteStore(made)) as store:
        store.append([assessment(T0 + n, speed_rpm=float(n)) for n in range(3)], [])
    return made


def told_to_prometheus(soundness: IntegrityMonitor) -> dict[str, float]:
    families = Families()
    add_integrity(families, soundness)
    return {s.name: s.value for metric in families.collect() for s in metric.samples}


async def test_of_what_is_sound_nothing_is_said(path, stepped_clock):
    with closing(SqliteStore(path)) as store:
        soundness = IntegrityMonitor(store, stepped_clock, LiveView([], stepped_clock, 30.0))
        await soundness.look()

        assert soundness.trouble is None
        assert told_to_prometheus(soundness) == {
            "padwatch_store_damaged_rows": 0.0,
            "padwatch_store_rolled_back": 0.0,
            "padwatch_store_mark_failing": 0.0,
        }
        assert store.audit.entries(AuditQuery()) == []


async def test_a_database_that_was_rolled_back_is_told_as_long_as_the_service_runs(
    path, stepped_clock, assessment, tmp_path
):
    old = tmp_path / "old"
    shutil.copyfile(path, old)
    with closing(SqliteStore(path)) as store:
        store.append([assessment(T0 + 9, speed_rpm=9.0)], [])
    shutil.copyfile(old, path)
    with closing(SqliteStore(path)) as store:
        soundness = IntegrityMonitor(store, stepped_clock, LiveView([], stepped_clock, 30.0))
        for _ in range(3):
            await soundness.look()

        assert soundness.trouble is not None
        assert "(2 in total)" in soundness.trouble
        assert len(store.audit.entries(AuditQuery(action="store.rolled_back"))) == 1
        assert told_to_prometheus(soundness)["padwatch_store_rolled_back"] == 1.0


@pytest.mark.parametrize("word", ["removed", "replaced"])
async def test_a_file_that_is_gone_is_told_and_nothing_is_written_until_it_is_back(
    path, stepped_clock, assessment, tmp_path, word
):
    assert LOOK_EVERY_S < 5.0
    live = LiveView([], stepped_clock, 30.0)
    with closing(SqliteStore(path)) as store:
        store.append([assessment(T0 + 8, speed_rpm=8.0)], [])
        soundness = IntegrityMonitor(store, stepped_clock, live)
        path.rename(tmp_path / "aside")
        if word == "replaced":
            path.touch()
        await soundness.look()

        assert f"the database file was {word} while padwatch runs" in (soundness.trouble or "")
        assert live.store_error == soundness.trouble
        for refused in (
            lambda: store.append([assessment(T0 + 9, speed_rpm=9.0)], []),
            lambda: store.trend(EVERYTHING),
        ):
            with pytest.raises(StoreError, match=word):
                refused()
        (tmp_path / "aside").replace(path)
        await soundness.look()

        assert (soundness.trouble, live.store_error) == (None, None)
        store.append([assessment(T0 + 9, speed_rpm=9.0)], [])
        assert list(store.trend(EVERYTHING).time_ns) == [T0 + n for n in (0, 1, 2, 8, 9)]


def test_a_log_is_not_taken_for_that_of_the_file_that_replaced_its_own(path, assessment, tmp_path):
    shutil.copyfile(path, tmp_path / "old")
    with closing(SqliteStore(path)) as store:
        store.append([assessment(T0 + n, speed_rpm=9.0) for n in range(3, 50)], [])
        (tmp_path / "old").replace(path)
    with closing(SqliteStore(path)) as store:
        assert "rolled_back" in [finding.kind for finding in store.integrity.found]
        assert list(store.trend(EVERYTHING).time_ns) == [T0 + n for n in range(3)]
    assert len(list(path.parent.glob("*.replaced-*-wal"))) == 1


async def test_rows_that_are_met_damaged_are_told_once_each(path, stepped_clock):
    with closing(sqlite3.connect(path)) as other, other:
        other.execute("UPDATE assessment SET coverage = 0.5")
    with closing(SqliteStore(path)) as store:
        soundness = IntegrityMonitor(store, stepped_clock, LiveView([], stepped_clock, 30.0))
        for _ in range(3):
            assert list(store.trend(EVERYTHING).time_ns) == []
            await soundness.look()
        told = store.audit.entries(AuditQuery(action="store.row_damaged"))

        assert soundness.trouble == "damaged or missing rows: 3 (see the audit trail)"
        assert told_to_prometheus(soundness)["padwatch_store_damaged_rows"] == 3.0
        assert sorted(entry.object for entry in told) == [
            f"assessment: series 1, time_ns {T0 + n}" for n in range(3)
        ]


def test_damage_is_an_alarm_of_danger_until_the_service_no_longer_knows_of_it():
    trouble: list[str | None] = ["damaged or missing rows: 3 (see the audit trail)"]
    alarms = ServiceAlarms((), None, lambda: ServiceHealth({"stored_trouble": trouble[0]}))
    (raised,) = (e for news in alarms.tick(T0) for e in news.events)
    trouble[0] = None
    (returned,) = (e for news in alarms.tick(T0 + 10**9) for e in news.events)

    assert raised.identity.kind == "stored_data_damaged"
    assert (raised.level, str(raised.reason)) == (
        AlarmLevel.DANGER,
        "damaged or missing rows: 3 (see the audit trail)",
    )
    assert returned.change.value == "returned"
