"""What blocks have taught reaches the disk, also when the disk does not answer for a while."""

import asyncio
import json
import math
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import structlog
from harness.waiting import until
from rigs.alarm_runs import PROBE, changes, play
from rigs.assessments import assessment
from rigs.store_fixtures import at, gap

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.life_cycle import update
from core.limits import AlarmLevel, Judgement
from core.monitor.assessment import Assessment
from core.samples.gaps import Gap
from service.measuring import recorder as recording
from service.measuring.recorder import COMMITS, FILE, NotStoredError, Recorder
from service.store.access.audit_entries import ActedNews
from service.store.port import TrendQuery, UnitGap

K = "order1_k_eff_xx_n_per_m"


def run_sql(path: Path, script: str) -> None:
    connection = sqlite3.connect(path, timeout=30)
    connection.executescript(script)
    connection.close()


def stored(plant: Any, unit: str = "U1") -> list[float | None]:
    query = TrendQuery(unit, "UJB", (K,), 0, 2**62, 5000, 2**62)
    return list(plant.store.trend(query).series[K].mean)


def break_store(plant: Any) -> None:
    run_sql(
        plant.path,
        "CREATE TRIGGER broken BEFORE INSERT ON assessment"
        " BEGIN SELECT RAISE(ABORT, 'disk I/O error'); END",
    )


def mend_store(plant: Any) -> None:
    run_sql(plant.path, "DROP TRIGGER broken")


async def test_what_blocks_teach_is_shown_and_stored(plant, scripted, block):
    n_blocks = 36  # 1024 + 4 hops of 896 samples
    sources = {
        name: scripted([block(number, name) for number in range(n_blocks)]) for name in ("U1", "U2")
    }

    await asyncio.wait_for(plant.runner(**sources).run(), 60)
    await plant.recorder.flush()

    for unit in sources:
        assert len(stored(plant, unit)) == 5
        newest = plant.live.assessment(unit, "UJB").readings[K].value
        assert stored(plant, unit)[-1] == newest
        assert abs(newest - 1.18e9 / 5) < 1e6
        account = plant.live.status(unit).account
        assert account.n_offered == account.n_stored == n_blocks * 128
        assert plant.live.status(unit).last_sample_ns == block(n_blocks, unit).start_ns


async def test_a_gap_is_stored_with_its_exact_length(plant, scripted, block):
    await play(plant, scripted, [block(n) for n in range(30) if n not in (4, 5, 6)])

    assert plant.store.gaps("U1", 0, 2**62) == [Gap(1, 4 * 128, 3 * 128, block(7).start_ns)]
    assert plant.live.status("U1").account.n_gap == 3 * 128
    assert plant.live.status("U1").account.n_offered == 30 * 128


async def test_a_store_that_fails_for_a_while_makes_the_service_unready_and_loses_nothing(
    plant, scripted, block
):
    break_store(plant)
    source = scripted([block(number) for number in range(36)], ends=False)
    running = asyncio.create_task(plant.runner(U1=source).run())
    await until(lambda: plant.live.store_error is not None)
    broken = plant.live.store_error
    await until(source.exhausted.is_set)
    assert stored(plant) == []
    mend_store(plant)
    await until(lambda: len(stored(plant)) == 5 and plant.live.store_error is None)
    running.cancel()
    await asyncio.wait([running])

    assert "disk I/O error" in broken
    assert plant.live.n_unstored == 0
    assert set(plant.clock.slept_s) == {1.0}
    assert stored(plant)[-1] == plant.live.assessment("U1", "UJB").readings[K].value


@pytest.mark.parametrize(
    ("finds_again", "said"),
    [
        (False, ("error", "results are lost: the process ends before they are stored")),
        (True, ("warning", "results are not stored; the next start repeats them")),
    ],
)
async def test_only_results_that_nobody_finds_again_are_said_to_be_lost(plant, finds_again, said):
    parts = (plant.store, plant.live, plant.clock, plant.path.parent)
    recorder = Recorder(*parts, finds_again=finds_again)
    break_store(plant)
    recorder.put([assessment()])
    with structlog.testing.capture_logs() as logs:
        await recorder.flush()
    assert said in [(line["log_level"], line["event"]) for line in logs]
    mend_store(plant)


@pytest.mark.parametrize("plant", [3], indirect=True)
async def test_what_does_not_fit_while_the_store_is_away_is_counted(plant):
    results = [assessment(at(n), order1_k_eff_xx_n_per_m=float(n)) for n in range(5)]
    break_store(plant)
    for result in results:
        plant.recorder.put([result])

    await plant.recorder.flush()
    mend_store(plant)
    await plant.recorder.flush()

    assert plant.live.n_unstored == 2
    assert stored(plant) == [2.0, 3.0, 4.0]


async def test_a_write_that_fails_is_not_timed(plant):
    def n_timed() -> float:
        [family] = COMMITS.collect()
        return next(each.value for each in family.samples if each.name.endswith("_count"))

    before = n_timed()
    break_store(plant)
    plant.recorder.put([assessment()])
    await plant.recorder.flush()
    assert n_timed() == before

    mend_store(plant)
    await plant.recorder.flush()
    assert n_timed() == before + 1


@pytest.mark.parametrize("plant", [3], indirect=True)
async def test_what_is_being_written_is_never_given_up(plant):
    gaps = [UnitGap("U1", Gap(1, n * 100, 10, n)) for n in range(7)]
    with closing(sqlite3.connect(plant.path)) as blocker:
        blocker.execute("BEGIN IMMEDIATE")
        for gap_ in gaps[:3]:
            plant.recorder.put([gap_])
        writing = asyncio.create_task(plant.recorder.flush())
        await until(plant.store._lock.locked)
        for gap_ in gaps[3:]:
            plant.recorder.put([gap_])
        blocker.rollback()
        await writing
    await plant.recorder.flush()

    assert plant.live.n_unstored == 1
    assert plant.store.gaps("U1", 0, 100) == [g.gap for g in gaps[:3] + gaps[4:]]


async def test_stopping_in_the_middle_of_a_write_loses_nothing_and_writes_nothing_twice(plant):
    gaps = [UnitGap("U1", Gap(1, n * 100, 10, n)) for n in range(5)]
    blocker = sqlite3.connect(plant.path)
    blocker.execute("BEGIN IMMEDIATE")
    recording = asyncio.create_task(plant.recorder.run())
    plant.recorder.put(gaps[:3])
    await until(plant.store._lock.locked)

    recording.cancel()
    await asyncio.wait([recording])
    plant.recorder.put(gaps[3:])
    blocker.rollback()
    blocker.close()
    await plant.recorder.flush()

    assert plant.store.gaps("U1", 0, 100) == [g.gap for g in gaps]


def news_of(subject: str) -> AlarmNews:
    """That a channel has failed."""
    identity = AlarmIdentity("U1", subject, "channel_not_ok")
    return AlarmNews(*update(Alarm(identity), Judgement(AlarmLevel.ALERT), at(0), AlarmRule()))


def without_coverage(found: Assessment) -> Assessment:
    return replace(found, window=replace(found.window, coverage=math.nan))


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (without_coverage, "NOT NULL constraint failed: assessment.coverage"),
        (lambda found: replace(found, time_ns=2**63), "too large"),
        (lambda found: replace(found, bearing="\ud800"), "surrogates"),
    ],
)
async def test_a_row_that_cannot_be_stored_is_parked_and_all_else_is_stored(plant, spoil, why):
    results = [assessment(at(n), order1_k_eff_xx_n_per_m=float(n)) for n in range(5)]
    plant.recorder.put([*results[:2], spoil(results[2]), gap(), news_of("sx")])
    nameless, of_a_person = news_of("\ud800"), news_of("\ud801")
    acted = ActedNews(of_a_person.alarm, of_a_person.events, peer="192.0.2.7")
    plant.recorder.put([*results[3:], nameless, acted, news_of("sy")])

    await plant.recorder.flush()

    assert stored(plant) == [0.0, 1.0, 3.0, 4.0]
    assert plant.store.gaps("U1", 0, 2**62) == [gap().gap]
    assert changes(plant, PROBE) == changes(plant, "U1:sy:channel_not_ok") == ["raised"]
    assert (plant.recorder.n_waiting, plant.live.store_error) == (0, None)
    rows = list(map(json.loads, plant.path.with_name(FILE).read_text().splitlines()))
    assert [row["kind"] for row in rows] == ["AlarmNews", "ActedNews", "Assessment"]
    alarm, person, result = rows
    assert person["row"]["peer"] == "192.0.2.7"
    assert alarm["row"]["events"][0]["identity"]["subject"] == "\ud800"
    assert why in result["reason"]
    assert result["row"]["readings"]["order1_k_eff_xx_n_per_m"]["value"] == 2.0
    assert plant.live.n_unstored == 3
    assert FILE in plant.live.unstored_reason


async def test_a_damaged_page_of_spectra_costs_the_spectra_alone(plant):
    plant.store.append([assessment(at(0), order1_k_eff_xx_n_per_m=0.0)], [])
    with closing(sqlite3.connect(plant.path)) as connection:
        pages = "SELECT rootpage FROM sqlite_master WHERE name = 'spectrum'"
        [(page,)] = connection.execute(pages)
        [(size,)] = connection.execute("PRAGMA page_size")
    plant.store.close()
    with plant.path.open("r+b") as file:
        file.seek((page - 1) * size)
        file.write(b"\xff" * size)
    damaged = type(plant)(plant.path)
    damaged.recorder.put([assessment(at(9000), order1_k_eff_xx_n_per_m=1.0)])

    await damaged.recorder.flush()

    assert stored(damaged) == [0.0, 1.0]
    assert damaged.recorder.n_waiting == 0
    assert "malformed" in damaged.live.unstored_reason
    damaged.store.close()


async def test_who_waits_for_the_disk_is_told_what_will_never_be_there(plant, monkeypatch):
    plant.recorder.put([news_of("\ud800")])
    refused = asyncio.create_task(plant.recorder.stored())
    await asyncio.sleep(0)
    await plant.recorder.flush()
    with pytest.raises(NotStoredError, match="surrogates"):
        await refused

    monkeypatch.setattr(recording, "MAX_NEWS", 1)
    plant.recorder.put([news_of("sx")])
    given_up = asyncio.create_task(plant.recorder.stored())
    await asyncio.sleep(0)
    plant.recorder.put([news_of("sy")])
    written = asyncio.create_task(plant.recorder.stored())
    with pytest.raises(NotStoredError, match="queue to the store is full"):
        await given_up
    await plant.recorder.flush()
    await written
    assert changes(plant, "U1:sy:channel_not_ok") == ["raised"]
