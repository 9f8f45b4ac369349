"""Several processes over one database: one trail, one number for each thing, names held by one."""

import multiprocessing
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from multiprocessing.synchronize import Barrier
from pathlib import Path

import pytest
from harness.places import PostgresPlace
from rigs.assessments import assessment
from rigs.store_fixtures import Build

from core.monitor.assessment import Assessment
from service.settings.storage import Origin
from service.store.access.audit_entries import AuditAction
from service.store.audit import AuditQuery
from service.store.port import StoreError
from service.store.postgres import PostgresStore
from service.store.postgres.connection import PostgresAddress
from service.store.postgres.database import PostgresDatabase, PostgresHold
from service.store.postgres.store import HEAD_BEGUN, server_trail

N_PROCESSES = 2
N_WRITES = 20

SPAWN = multiprocessing.get_context("spawn")


def write(
    conninfo: str, head: str, number: int, made: list[Assessment], all_there: Barrier
) -> None:
    """Write results and deeds, as one of several."""
    with closing(PostgresStore(PostgresAddress(conninfo), Path(head))) as store:
        all_there.wait(60)
        for n, one in enumerate(made):
            store.append([one], [])
            store.audit.record([AuditAction(n, f"process {number}", "test.done", f"{n}")])


def all_write(place: PostgresPlace, folder: Path, build: Build) -> list[int]:
    """Let processes write at the same time; how they have ended."""
    jobs, all_there = [], SPAWN.Barrier(N_PROCESSES)
    for number in range(N_PROCESSES):
        made = [build(1_000 * n + number, unit=f"U{n % 5}") for n in range(N_WRITES)]
        head = str(folder / str(number) / "head.json")
        arguments = (place.address.conninfo, head, number, made, all_there)
        jobs.append(SPAWN.Process(target=write, args=arguments))
    for job in jobs:
        job.start()
    for job in jobs:
        job.join()
    return [job.exitcode or 0 for job in jobs]


def test_processes_write_at_the_same_time_and_the_trail_is_one_chain(
    postgres_place: PostgresPlace, tmp_path: Path
) -> None:
    assert all_write(postgres_place, tmp_path, assessment) == [0] * N_PROCESSES

    assert postgres_place.execute("SELECT count(*) FROM assessment") == [(N_PROCESSES * N_WRITES,)]
    assert postgres_place.execute("SELECT count(*) FROM series") == [(5,)]
    assert postgres_place.execute("SELECT count(*) FROM layout") == [(1,)]
    for number in range(N_PROCESSES):
        head = tmp_path / str(number) / "head.json"
        verdict = server_trail(postgres_place.address, head).verify()
        assert verdict.is_whole
        assert verdict.n_entries >= N_PROCESSES * N_WRITES
        assert not verdict.contradictions


def test_a_database_is_brought_up_to_date_by_one_of_two_that_open_it(
    own_place: PostgresPlace,
) -> None:
    with ThreadPoolExecutor(3) as pool:
        stores = list(pool.map(lambda _: own_place.open(), range(3)))
    for store in stores:
        store.close()
    assert own_place.execute("SELECT count(*) FROM padwatch") == [(1,)]


def test_a_host_that_comes_later_begins_its_head_and_says_so(
    postgres_place: PostgresPlace, tmp_path: Path
) -> None:
    with closing(postgres_place.open()) as store:
        store.audit.record([AuditAction(1, "anna", "test.done", "one")])
    elsewhere = tmp_path / "elsewhere" / "head.json"
    with closing(PostgresStore(postgres_place.address, elsewhere)) as store:
        actions = [entry.action for entry in store.audit.entries(AuditQuery())]
        store.audit.record([AuditAction(n, "anna", "test.done", "two") for n in range(70)])

    assert actions == [HEAD_BEGUN, "test.done"]
    assert server_trail(postgres_place.address, elsewhere).verify().is_whole
    here = server_trail(postgres_place.address, postgres_place.head).verify()
    assert (here.finding, here.n_behind, here.is_shared) == (None, 71, True)


def test_a_trail_that_was_cut_is_noticed_by_every_host(
    postgres_store: PostgresStore, postgres_place: PostgresPlace
) -> None:
    for n in range(3):
        postgres_store.audit.record([AuditAction(n, "anna", "test.done", str(n))])
    with pytest.raises(postgres_place.refusal, match="kept"):
        postgres_place.execute("DELETE FROM audit WHERE number = 3")
    with pytest.raises(postgres_place.refusal, match="kept"):
        postgres_place.execute("TRUNCATE audit")
    postgres_place.unguard("audit_kept", "audit")
    postgres_place.execute("DELETE FROM audit WHERE number = 3")

    assert not server_trail(postgres_place.address, postgres_place.head).verify().is_whole


def test_a_name_is_held_by_one_and_whoever_is_refused_learns_by_whom(
    postgres_store: PostgresStore, postgres_place: PostgresPlace
) -> None:
    other = PostgresDatabase(postgres_place.address, Origin.LIVE)
    with closing(other), postgres_store.database.hold("unit U1") as hold:
        assert hold.is_held
        with pytest.raises(StoreError, match="unit U1 is held by another padwatch"):
            other.hold("unit U1").__enter__()
        with other.hold("unit U2") as second:
            assert second.is_held
    with held_soon(other, "unit U1") as again:
        assert again.is_held
    assert not hold.is_held


@contextmanager
def held_soon(database: PostgresDatabase, name: str) -> Iterator[PostgresHold]:
    """Take a name as soon as the server has ended the session that held it."""
    for _ in range(600):
        with suppress(StoreError), database.hold(name) as hold:
            yield hold
            return
        time.sleep(0.05)
    pytest.fail(f"{name} is still held")


def test_a_holder_learns_that_it_has_lost_its_name(
    own_store: PostgresStore, own_place: PostgresPlace
) -> None:
    with own_store.database.hold("unit U1") as hold:
        assert hold.is_held
        own_place.server.restart()
        with own_store.database.hold("unit U1") as successor:
            assert not hold.is_held
            assert successor.is_held
        assert not hold.is_held
