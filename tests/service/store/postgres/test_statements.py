"""Statements and migrations, written for PostgreSQL."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing

import pytest
from harness.places import PostgresPlace

from service.store import schema
from service.store.postgres.connection import translated
from service.store.postgres.schema import for_postgres


@pytest.mark.parametrize(
    ("written", "wanted"),
    [
        ("SELECT ? , ?", "SELECT %s , %s"),
        ("WHERE :unit = unit AND b = :b_2", "WHERE %(unit)s = unit AND b = %(b_2)s"),
        ("x LIKE '%?:a''?' || y % :n", "x LIKE '%%?:a''?' || y %% %(n)s"),
        ("a::bigint = ?", "a::bigint = %s"),
    ],
)
def test_parameters_are_found_and_what_is_quoted_is_left_alone(written: str, wanted: str) -> None:
    assert translated(written) == wanted.encode()


def test_a_trigger_of_an_unknown_shape_is_no_silent_loss() -> None:
    with pytest.raises(ValueError, match="cannot be translated"):
        for_postgres("CREATE TRIGGER t INSTEAD OF DELETE ON v BEGIN SELECT 1; END;")


@pytest.fixture
def file() -> Iterator[sqlite3.Connection]:
    """A SQLite database with the newest schema."""
    with closing(sqlite3.connect(":memory:")) as opened:
        for migration in schema.MIGRATIONS:
            opened.executescript(migration)
        yield opened


def test_both_databases_have_the_same_tables_columns_and_keys(
    postgres_place: PostgresPlace, file: sqlite3.Connection
) -> None:
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


def test_every_trigger_is_there_in_both(
    postgres_place: PostgresPlace, file: sqlite3.Connection
) -> None:
    in_file = file.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall()
    on_server = postgres_place.execute(
        "SELECT tgname FROM pg_trigger WHERE NOT tgisinternal AND tgname NOT LIKE '%_all'"
    )
    assert set(on_server) == set(in_file)
