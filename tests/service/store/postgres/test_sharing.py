"""Processes that share a server, connections that are lost, and the way back from a dump."""

import multiprocessing
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from contextvars import copy_context
from dataclasses import replace
from multiprocessing.synchronize import Barrier
from pathlib import Path

import psycopg
import pytest
from harness.places import PostgresPlace
from rigs.assessments import assessment
from rigs.store_fixtures import Build, at, query

from core.monitor.assessment import Assessment
from service.runtime.asker import ASKER, Asker
from service.settings.storage import Origin
from service.store.access.audit_entries import AuditAction
from service.store.audit import AuditQuery
from service.store.port import StoreError
from service.store.postgres import PostgresStore
from service.store.postgres.connection import PostgresAddress
from service.store.postgres.database import PostgresDatabase, PostgresHold, Readers
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


@pytest.mark.long
def test_processes_write_at_the_same_time_and_the_trail_is_one_chain(postgres_place, tmp_path):
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


def test_a_database_is_brought_up_to_date_by_one_of_two_that_open_it(own_place):
    with ThreadPoolExecutor(3) as pool:
        stores = list(pool.map(lambda _: own_place.open(), range(3)))
    for store in stores:
        store.close()
    assert own_place.execute("SELECT count(*) FROM padwatch") == [(1,)]


def test_a_host_that_comes_later_begins_its_head_and_says_so(postgres_place, tmp_path):
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


def test_a_trail_that_was_cut_is_noticed_by_every_host(postgres_store, postgres_place):
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
    postgres_store, postgres_place
):
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


def test_a_holder_learns_that_it_has_lost_its_name(own_store, own_place):
    with own_store.database.hold("unit U1") as hold:
        assert hold.is_held
        own_place.server.restart()
        with own_store.database.hold("unit U1") as successor:
            assert not hold.is_held
            assert successor.is_held
        assert not hold.is_held


N_CUTS = 6
COMMIT = b"COMMIT\0"
"""As a statement of its own; BEGIN tells of read committed, too."""


def stored(place: PostgresPlace) -> list[int]:
    """Times of what is in the database, each as often as it is there."""
    return [time for (time,) in place.execute("SELECT time_ns FROM assessment ORDER BY time_ns")]


def test_a_commit_with_a_lost_answer_is_looked_up_and_counts_once(cut_store, proxy, postgres_place):
    for number in range(N_CUTS):
        proxy.cut_at(COMMIT, reaches=True)
        cut_store.append([assessment(at(number))], [])

    assert proxy.n_cut == N_CUTS
    assert stored(postgres_place) == [at(number) for number in range(N_CUTS)]


def test_a_commit_that_never_reached_the_server_is_an_error_and_the_next_write_works(
    cut_store, proxy, postgres_place
):
    made = [assessment(at(number)) for number in range(N_CUTS)]
    for one in made:
        proxy.cut_at(COMMIT, reaches=False)
        with pytest.raises(StoreError):
            cut_store.append([one], [])

    assert proxy.n_cut == N_CUTS
    assert stored(postgres_place) == []
    cut_store.append(made, [])
    cut_store.append(made, [])
    assert len(stored(postgres_place)) == N_CUTS


def test_what_was_acknowledged_outlives_a_server_that_stops_dead(own_store, own_place):
    for number in range(2):
        own_store.append([assessment(at(number))], [])
        own_place.server.restart("immediate")

    assert stored(own_place) == [at(0), at(1)]


def test_a_store_goes_on_after_the_server_was_started_anew(own_store, own_place):
    own_store.append([assessment(at(0))], [])
    assert len(own_store.trend(query()).time_ns) == 1
    own_place.server.restart()
    assert len(own_store.trend(query()).time_ns) == 1
    own_place.server.restart()
    own_store.append([assessment(at(1))], [])
    own_place.server.stop()
    try:
        with pytest.raises(StoreError, match="check that PostgreSQL runs"):
            own_store.append([assessment(at(2))], [])
        with pytest.raises(StoreError, match="check that PostgreSQL runs"):
            own_store.trend(query())
    finally:
        own_place.server.start()
    own_store.append([assessment(at(2))], [])
    assert len(own_store.trend(query()).time_ns) == 3


def test_a_stop_in_the_middle_of_a_transaction_leaves_nothing_of_it(own_store, own_place):
    with (  # noqa: PT012
        pytest.raises(StoreError, match="padwatch retries"),
        own_store.database.writing() as w,
    ):
        w.execute("INSERT INTO series (unit, bearing) VALUES (?, ?)", ("U1", "UJB"))
        own_place.server.restart()
        w.execute("INSERT INTO series (unit, bearing) VALUES (?, ?)", ("U2", "UJB"))

    assert own_place.execute("SELECT count(*) FROM series") == [(0,)]
    own_store.append([assessment(at(0))], [])


def test_every_commit_waits_for_the_disk(postgres_place):
    postgres_place.execute(f"ALTER DATABASE {postgres_place.database} SET synchronous_commit = off")
    with closing(postgres_place.open()) as store, store.database.writing() as writer:
        assert writer.execute("SHOW synchronous_commit").fetchone() == ("on",)


def test_what_an_error_has_undone_is_never_taken_for_written(postgres_store, postgres_place):
    with (
        pytest.raises(StoreError, match="the server rolled the transaction back after an error"),
        postgres_store.database.writing() as writer,
        suppress(psycopg.Error),
    ):
        writer.execute("SELECT 1 / 0")
    bad = replace(assessment(at(0)), unit="no\0text")
    with pytest.raises(StoreError, match="NUL"):
        postgres_store.append([assessment(at(1)), bad], [])

    assert stored(postgres_place) == []


def test_a_dump_of_a_live_database_is_put_back_with_all_that_it_guards(own_place):
    server, dump = own_place.server, own_place.server.folder / "padwatch.dump"
    with closing(own_place.open()) as store:
        store.append([assessment(at(0), speed_rpm=92.3)], [])
        store.audit.record([AuditAction(1, "anna", "test.done", "before the copy")])
        there = own_place.address.conninfo
        server.run("pg_dump", "--format=custom", f"--file={dump}", f"--dbname={there}")
        store.audit.record([AuditAction(2, "anna", "test.done", "after it")])
    back = PostgresPlace(server, f"{own_place.database}_back", own_place.head.parent)
    server.create(back.database)
    server.run("pg_restore", f"--dbname={back.address.conninfo}", "--exit-on-error", dump)

    verdict = server_trail(back.address, back.head).verify()
    with closing(back.open()) as store:
        assert list(store.trend(query()).series["speed_rpm"].mean) == [92.3]
        store.append([assessment(at(1), speed_rpm=92.4)], [])
        assert list(store.trend(query()).series["speed_rpm"].mean) == [92.3, 92.4]
    assert not verdict.is_whole
    assert verdict.finding is not None
    assert verdict.finding.detail == "entry 2 is missing at the end: the head file names entry 2"
    guards = "SELECT count(*) FROM pg_trigger WHERE NOT tgisinternal"
    assert back.execute(guards) == own_place.execute(guards)
    server.drop(back.database)


def test_a_read_is_cancelled_at_the_server_when_its_client_disconnects(postgres_place):
    asker, readers = Asker(), Readers(postgres_place.address)

    def read() -> None:
        ASKER.set(asker)
        with readers.reading() as connection:
            connection.execute("SELECT pg_sleep(600)")

    with ThreadPoolExecutor(1) as threads, closing(readers):
        reading = threads.submit(copy_context().run, read)
        sleeping = "SELECT 1 FROM pg_stat_activity WHERE query LIKE '%pg_sleep(600)' AND datname = "
        while not postgres_place.server.execute(f"{sleeping}'{postgres_place.database}'"):
            time.sleep(0.01)
        asker.leave()
        with pytest.raises(StoreError, match="the client has disconnected"):
            reading.result()
