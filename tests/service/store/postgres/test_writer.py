"""Connections that are lost, and servers that stop, while results are written."""

from contextlib import closing, suppress
from dataclasses import replace

import psycopg
import pytest
from harness.cutting_proxy import CuttingProxy
from harness.places import PostgresPlace
from rigs.assessments import assessment
from rigs.store_fixtures import at, query

from service.store.port import StoreError
from service.store.postgres import PostgresStore

N_CUTS = 6
COMMIT = b"COMMIT\0"
"""As a statement of its own; BEGIN tells of read committed, too."""


def stored(place: PostgresPlace) -> list[int]:
    """Times of what is in the database, each as often as it is there."""
    return [time for (time,) in place.execute("SELECT time_ns FROM assessment ORDER BY time_ns")]


def test_a_commit_whose_answer_is_lost_is_looked_up_and_counts_once(
    cut_store: PostgresStore, proxy: CuttingProxy, postgres_place: PostgresPlace
) -> None:
    for number in range(N_CUTS):
        proxy.cut_at(COMMIT, reaches=True)
        cut_store.append([assessment(at(number))], [])

    assert proxy.n_cut == N_CUTS
    assert stored(postgres_place) == [at(number) for number in range(N_CUTS)]


def test_a_commit_that_never_reached_the_server_is_an_error_and_the_next_write_works(
    cut_store: PostgresStore, proxy: CuttingProxy, postgres_place: PostgresPlace
) -> None:
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


def test_what_was_acknowledged_outlives_a_server_that_stops_dead(
    own_store: PostgresStore, own_place: PostgresPlace
) -> None:
    for number in range(2):
        own_store.append([assessment(at(number))], [])
        own_place.server.restart("immediate")

    assert stored(own_place) == [at(0), at(1)]


def test_a_store_goes_on_after_the_server_was_started_anew(
    own_store: PostgresStore, own_place: PostgresPlace
) -> None:
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


def test_a_stop_in_the_middle_of_a_transaction_leaves_nothing_of_it(
    own_store: PostgresStore, own_place: PostgresPlace
) -> None:
    with (  # noqa: PT012
        pytest.raises(StoreError, match="padwatch retries"),
        own_store.database.writing() as w,
    ):
        w.execute("INSERT INTO series (unit, bearing) VALUES (?, ?)", ("U1", "UJB"))
        own_place.server.restart()
        w.execute("INSERT INTO series (unit, bearing) VALUES (?, ?)", ("U2", "UJB"))

    assert own_place.execute("SELECT count(*) FROM series") == [(0,)]
    own_store.append([assessment(at(0))], [])


def test_every_commit_waits_for_the_disk(postgres_place: PostgresPlace) -> None:
    postgres_place.execute(f"ALTER DATABASE {postgres_place.database} SET synchronous_commit = off")
    with closing(postgres_place.open()) as store, store.database.writing() as writer:
        assert writer.execute("SHOW synchronous_commit").fetchone() == ("on",)


def test_what_an_error_has_undone_is_never_taken_for_written(
    postgres_store: PostgresStore, postgres_place: PostgresPlace
) -> None:
    with (
        pytest.raises(StoreError, match="an error rolled the transaction back"),
        postgres_store.database.writing() as writer,
        suppress(psycopg.Error),
    ):
        writer.execute("SELECT 1 / 0")
    bad = replace(assessment(at(0)), unit="no\0text")
    with pytest.raises(StoreError, match="NUL"):
        postgres_store.append([assessment(at(1)), bad], [])

    assert stored(postgres_place) == []
