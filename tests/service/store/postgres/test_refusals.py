"""Statements are written for PostgreSQL; a server that will not do is refused with the reason."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing

import pytest
from harness.postgres_server import PostgresServer
from rigs.assessments import assessment
from rigs.memory_folder import memory_folder

from service.store import schema
from service.store.port import StoreError
from service.store.postgres import PostgresStore, connection
from service.store.postgres.connection import PostgresAddress, translated
from service.store.postgres.schema import for_postgres


def refused(address: PostgresAddress) -> str:
    """Try to open a store; what is said."""
    with memory_folder() as folder, pytest.raises(StoreError) as refusal:
        PostgresStore(address, folder / "head.json")
    said = str(refusal.value)
    assert "\n" not in said
    assert PostgresServer.PASSWORD not in said
    return said


def test_a_server_that_does_not_run_is_named(tmp_path):
    said = refused(PostgresAddress(f"host={tmp_path} dbname=padwatch user=p"))

    assert said.startswith(f"PostgreSQL database padwatch at {tmp_path}: ")
    assert said.endswith("check that PostgreSQL runs and can be reached; padwatch retries")


def test_a_database_or_a_role_that_is_not_there_is_said(postgres_server):
    there = postgres_server.conninfo("nothing_like_it")

    assert "does not exist; create it (see the how-to" in refused(PostgresAddress(there))
    there = there.replace("user=postgres", "user=nobody_here")
    assert "does not exist; create it (see the how-to" in refused(PostgresAddress(there))


@pytest.mark.parametrize(
    ("password", "mode", "complaint"),
    [
        (b"wrong", 0o600, "password authentication failed"),
        (b"", 0o600, "password_file"),
        (b"x", 0o640, "is readable by others; run chmod 600 on it"),
    ],
)
def test_a_wrong_password_is_refused_and_not_shown(
    postgres_place, tmp_path, password, mode, complaint
):
    path = tmp_path / "password"
    path.write_bytes(password)
    path.chmod(mode)
    there = postgres_place.server.conninfo(postgres_place.database, by="tcp")

    assert complaint in refused(PostgresAddress(there, path))
    assert "No such file" in refused(PostgresAddress(there, tmp_path / "none"))


def test_a_database_of_another_program_is_refused_and_left_as_it_is(own_place):
    own_place.execute("CREATE TABLE precious (a int)")

    said = refused(own_place.address)

    assert "is not a padwatch database; create one for padwatch alone" in said
    tables = "SELECT table_name FROM information_schema.tables WHERE table_schema = 'public'"
    assert own_place.execute(tables) == [("precious",)]


def test_a_server_that_loses_results_at_a_power_cut_is_refused(postgres_server):
    with PostgresServer(postgres_server, fsync="off") as careless:
        careless.create("padwatch")
        address = PostgresAddress(careless.conninfo("padwatch"))
        said = refused(address)

    assert "would lose results at a power cut: set fsync = on" in said


def test_a_server_that_is_too_old_is_refused(postgres_place, monkeypatch):
    monkeypatch.setattr(connection, "OLDEST_VERSION", 990_000)  # as if time had gone on

    assert "which is too old: padwatch needs 99 or newer" in refused(postgres_place.address)


def test_a_database_in_another_encoding_is_refused(own_server):
    own_server.execute("CREATE DATABASE latin TEMPLATE template0 ENCODING 'LATIN1' LOCALE 'C'")

    said = refused(PostgresAddress(own_server.conninfo("latin")))

    assert "has the encoding LATIN1: create it with ENCODING 'UTF8'" in said


def test_a_role_that_may_not_write_is_refused(postgres_place):
    there = postgres_place.address.conninfo.replace("user=postgres", "user=looker")
    postgres_place.execute("DROP ROLE IF EXISTS looker")
    postgres_place.execute("CREATE ROLE looker LOGIN")

    said = refused(PostgresAddress(there))

    assert "permission denied" in said
    assert "grant the rights" in said


def test_a_standby_is_refused(own_place):
    server = own_place.server
    own_place.open().close()
    server.stop()
    (server.data / "standby.signal").touch()
    try:
        server.start()
        said = refused(own_place.address)
    finally:
        server.stop()
        (server.data / "standby.signal").unlink()
        server.start()

    assert "is a read-only standby: name the primary" in said


def test_a_reader_can_write_nothing(postgres_store):
    with (
        pytest.raises(StoreError, match="read-only transaction"),
        postgres_store.database.reading() as reader,
    ):
        reader.execute("DELETE FROM gap")


def test_a_query_that_takes_too_long_ends_with_a_sentence(postgres_store, monkeypatch):
    monkeypatch.setattr(
        "service.store.postgres.database.READER_SETTINGS", "SET statement_timeout = '20ms';"
    )
    with (
        pytest.raises(StoreError, match="the query timed out: the database is too slow"),
        postgres_store.database.reading() as reader,
    ):
        reader.execute("SELECT pg_sleep(10)")


def test_a_full_disk_is_named_as_such(postgres_store, postgres_place):
    postgres_place.execute(
        "CREATE FUNCTION full_disk() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN"
        " RAISE EXCEPTION 'could not extend file' USING ERRCODE = 'disk_full'; END $$"
    )
    postgres_place.execute(
        "CREATE TRIGGER full_disk BEFORE INSERT ON assessment"
        " FOR EACH ROW EXECUTE FUNCTION full_disk()"
    )
    with pytest.raises(StoreError, match="the disk of the database is full: free space there"):
        postgres_store.append([assessment()], [])
    postgres_place.unguard("full_disk", "assessment")
    postgres_store.append([assessment()], [])


@pytest.mark.parametrize(
    ("written", "wanted"),
    [
        ("SELECT ? , ?", "SELECT %s , %s"),
        ("WHERE :unit = unit AND b = :b_2", "WHERE %(unit)s = unit AND b = %(b_2)s"),
        ("x LIKE '%?:a''?' || y % :n", "x LIKE '%%?:a''?' || y %% %(n)s"),
        ("a::bigint = ?", "a::bigint = %s"),
    ],
)
def test_parameters_are_found_and_what_is_quoted_is_left_alone(written, wanted):
    assert translated(written) == wanted.encode()


def test_a_trigger_of_an_unknown_shape_is_no_silent_loss():
    with pytest.raises(ValueError, match="cannot be translated"):
        for_postgres("CREATE TRIGGER t INSTEAD OF DELETE ON v BEGIN SELECT 1; END;")


@pytest.fixture
def file() -> Iterator[sqlite3.Connection]:
    """A SQLite database with the newest schema."""
    with closing(sqlite3.connect(":memory:")) as opened:
        for migration in schema.MIGRATIONS:
            opened.executescript(migration)
        yield opened


def test_both_databases_have_the_same_tables_columns_and_keys(postgres_place, file):
    named = "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%'"
    in_file = {
        (table, row[1], bool(row[5]))
        for (table,) in file.execute(named)
        for row in file.execute(f"PRAGMA table_info({table})")
    }
    on_server = {
        tuple(row)
        for row in postgres_place.execute(
            "SELECT c.table_name, c.column_name, k.column_name IS NOT NULL"
            " FROM information_schema.columns c LEFT JOIN (SELECT u.table_name, u.column_name"
            " FROM information_schema.key_column_usage u"
            " JOIN information_schema.table_constraints t USING (constraint_name)"
            " WHERE t.constraint_type = 'PRIMARY KEY') k"
            " ON k.table_name = c.table_name AND k.column_name = c.column_name"
            " WHERE c.table_schema = 'public' AND c.table_name <> 'padwatch'"
        )
    }
    assert on_server == in_file


def test_every_trigger_is_there_in_both(postgres_place, file):
    in_file = file.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall()
    on_server = postgres_place.execute(
        "SELECT tgname FROM pg_trigger WHERE NOT tgisinternal AND tgname NOT LIKE '%_all'"
    )
    assert set(on_server) == set(in_file)
