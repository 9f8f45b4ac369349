"""Connections that are lost, and servers that stop, while results are written."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import psycopg
import pytest
from harness.cutting_proxy import CuttingProxy
from harness.places import PostgresPlace

from core.assessment import Assessment
from service.store.port import StoreError, TrendQuery
from service.store.postgres import PostgresStore
from service.store.postgres import writer as writer_module
from service.store.postgres.writer import Writer

Build = Callable[..., Assessment]
At = Callable[[int], int]
Ask = Callable[..., TrendQuery]

N_CUTS = 6
COMMIT = b"COMMIT\0"
"""As a statement of its own; BEGIN tells of read committed, too."""
HASTY = writer_module.SETTINGS.replace("synchronous_commit = on", "synchronous_commit = off")


def stored(place: PostgresPlace) -> list[int]:
    """Times of what is in the database, each as often as it is there."""
    return [time for (time,) in place.execute("SELECT time_ns FROM assessment ORDER BY time_ns")]


def test_a_commit_whose_answer_is_lost_is_looked_up_and_counts_once(
    cut_store: PostgresStore,
    proxy: CuttingProxy,
    postgres_place: PostgresPlace,
    assessment: Build,
    at: At,
) -> None:
    for number in range(N_CUTS):
        proxy.cut_at(COMMIT, reaches=True)
        cut_store.append([assessment(at(number))], [])

    assert proxy.n_cut == N_CUTS
    assert stored(postgres_place) == [at(number) for number in range(N_CUTS)]


def acknowledged_though_lost(
    store: PostgresStore, proxy: CuttingProxy, place: PostgresPlace, made: list[Assessment]
) -> list[int]:
    """Cut each commit before the server hears it; what was promised and is not there, by time."""
    promised = []
    for one in made:
        proxy.cut_at(COMMIT, reaches=False)
        try:
            store.append([one], [])
        except StoreError:
            continue
        promised.append(one.time_ns)
    return sorted(set(promised) - set(stored(place)))


def test_a_commit_that_never_reached_the_server_is_an_error_and_the_next_write_works(
    cut_store: PostgresStore,
    proxy: CuttingProxy,
    postgres_place: PostgresPlace,
    assessment: Build,
    at: At,
) -> None:
    made = [assessment(at(number)) for number in range(N_CUTS)]

    assert acknowledged_though_lost(cut_store, proxy, postgres_place, made) == []

    assert proxy.n_cut == N_CUTS
    assert stored(postgres_place) == []
    cut_store.append(made, [])
    cut_store.append(made, [])
    assert len(stored(postgres_place)) == N_CUTS


@pytest.mark.planted("a commit without an answer taken for written, in PostgreSQL")
def test_a_writer_that_takes_silence_for_success_is_caught(
    cut_store: PostgresStore,
    proxy: CuttingProxy,
    postgres_place: PostgresPlace,
    assessment: Build,
    at: At,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Writer, "_settle", lambda *_: None)
    made = [assessment(at(number)) for number in range(N_CUTS)]

    assert acknowledged_though_lost(cut_store, proxy, postgres_place, made)


def lost_at_power_cuts(place: PostgresPlace, make: Callable[[int], Assessment]) -> int:
    """Append, and stop the server as a power cut would; how many of what was promised are gone."""
    promised = []
    for number in range(2):
        store = place.open()
        try:
            store.append([make(number)], [])
        finally:
            promised.append(make(number).time_ns)
            place.server.stop("immediate")
            place.server.start()
            store.close()
    return len(set(promised) - set(stored(place)))


def test_what_was_acknowledged_outlives_a_server_that_stops_dead(
    own_place: PostgresPlace, assessment: Build, at: At
) -> None:
    assert lost_at_power_cuts(own_place, lambda number: assessment(at(number))) == 0


@pytest.mark.planted("synchronous_commit off, in PostgreSQL")
def test_commits_that_do_not_wait_for_the_disk_are_caught(
    own_place: PostgresPlace, assessment: Build, at: At, monkeypatch: pytest.MonkeyPatch
) -> None:
    own_place.open().close()
    monkeypatch.setattr(writer_module, "SETTINGS", HASTY)

    assert lost_at_power_cuts(own_place, lambda number: assessment(at(number))) > 0


def test_a_store_goes_on_after_the_server_was_started_anew(
    own_place: PostgresPlace, assessment: Build, at: At, query: Ask
) -> None:
    store = own_place.open()
    try:
        store.append([assessment(at(0))], [])
        assert len(store.trend(query()).time_ns) == 1
        own_place.server.restart()
        assert len(store.trend(query()).time_ns) == 1
        own_place.server.restart()
        store.append([assessment(at(1))], [])
        own_place.server.stop()
        with pytest.raises(StoreError, match="see whether PostgreSQL runs"):
            store.append([assessment(at(2))], [])
        with pytest.raises(StoreError, match="see whether PostgreSQL runs"):
            store.trend(query())
        own_place.server.start()
        store.append([assessment(at(2))], [])
        assert len(store.trend(query()).time_ns) == 3
    finally:
        store.close()


def test_a_stop_in_the_middle_of_a_transaction_leaves_nothing_of_it(
    own_place: PostgresPlace, assessment: Build, at: At
) -> None:
    store = own_place.open()

    def write_while_the_server_stops() -> None:
        with store.database.writing() as writer:
            writer.execute("INSERT INTO series (unit, bearing) VALUES (?, ?)", ("U1", "UJB"))
            own_place.server.restart()
            writer.execute("INSERT INTO series (unit, bearing) VALUES (?, ?)", ("U2", "UJB"))

    try:
        with pytest.raises(StoreError, match="it is tried again"):
            write_while_the_server_stops()
        assert own_place.execute("SELECT count(*) FROM series") == [(0,)]
        store.append([assessment(at(0))], [])
    finally:
        store.close()


def test_every_commit_waits_for_the_disk(postgres_place: PostgresPlace) -> None:
    postgres_place.execute(f"ALTER DATABASE {postgres_place.database} SET synchronous_commit = off")
    store = postgres_place.open()
    try:
        with store.database.writing() as writer:
            assert writer.execute("SHOW synchronous_commit").fetchone() == ("on",)
    finally:
        store.close()


def test_what_an_error_has_undone_is_never_taken_for_written(
    postgres_place: PostgresPlace, assessment: Build, at: At
) -> None:
    store = postgres_place.open()

    def write_without_care() -> None:
        with store.database.writing() as writer, suppress(psycopg.Error):
            writer.execute("SELECT 1 / 0")

    try:
        with pytest.raises(StoreError, match="undone by an error"):
            write_without_care()
        bad = replace(assessment(at(0)), unit="no\0text")
        with pytest.raises(StoreError, match="NUL"):
            store.append([assessment(at(1)), bad], [])
        assert stored(postgres_place) == []
    finally:
        store.close()
