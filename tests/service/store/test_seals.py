"""What is not as it was written is left out and told, and is in no roll-up."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from rigs.assessments import assessment
from rigs.rolled_trends import gather_all
from rigs.store_fixtures import at, query

from service.store.access.identities import Role
from service.store.access.tables import AccessStore
from service.store.port import StoreError, TrendQuery, ValueRange
from service.store.references import GapReference, ReferenceSource
from service.store.seals import MAX_PLACES, DamageLog, Place, initial_crc, seal_of
from service.store.sqlite import SqliteStore
from service.store.sqlite.checking import findings
from service.store.sqlite.store import open_access_file


def test_whatever_is_changed_in_a_row_changes_its_seal():
    row = (1, 2.5, b"text", None, b"\0\0")
    others = [
        (1, 2.5, b"text", None, b"\0\1"),
        (1, 2.5, b"texu", None, b"\0\0"),
        (1, 2.5, b"tex", None, b"t\0\0"),
        (1, 2.5, b"text", 0, b"\0\0"),
        (1, 2.5000000000000004, b"text", None, b"\0\0"),
        (0, 2.5, b"text", None, b"\0\0"),
        (1, 2.5, b"text", None, b"\0"),
        (1, 2.5, b"text", b"\0\0", None),
    ]

    assert len({seal_of(initial_crc("t"), cells) for cells in (row, *others)}) == 1 + len(others)
    assert seal_of(initial_crc("t"), row) != seal_of(initial_crc("u"), row)


def test_equal_rows_have_equal_seals_wherever_their_values_come_from():
    text = b"text"
    row = (1, 2**40, -(2**63), 2.5, -0.0, text, None, b"", text)
    same = (1, 2**40, -(2**63), 2.5, -0.0, bytes(bytearray(text)), None, b"", bytes([*text]))

    assert seal_of(initial_crc("t"), row) == seal_of(initial_crc("t"), same)
    # as rows that were sealed before have it
    assert seal_of(initial_crc("t"), row) == 1_750_905_859


@pytest.mark.parametrize(
    "change",
    [
        "reading_values = zeroblob(length(reading_values))",
        "reading_qualities = zeroblob(length(reading_qualities))",
        "oil_temperature_c = 1.0",
        "speed_source = 'rated'",
        "layout = 2",
        "estimator_xx = 'ratio'",
        "time_ns = time_ns + 1",
    ],
)
def test_a_reading_that_was_altered_or_moved_is_not_shown(store, execute, change):
    store.append([assessment(at(n), speed_rpm=float(n)) for n in range(5)], [])

    execute(f"UPDATE assessment SET {change} WHERE time_ns = {at(2)}")  # noqa: S608

    assert list(store.trend(query("speed_rpm")).series["speed_rpm"].mean) == [0.0, 1.0, 3.0, 4.0]
    assert store.integrity.n_damaged == 1
    found_ns = at(2) + change.startswith("time_ns")
    assert store.integrity.damaged == [Place("assessment", f"series 1, time_ns {found_ns}")]


def test_a_bearing_whose_name_was_altered_is_neither(store, execute):
    store.append([assessment(speed_rpm=92.3)], [])
    execute("UPDATE series SET bearing = 'LJB'")

    for bearing in ("UJB", "LJB"):
        assert list(store.trend(query("speed_rpm", bearing=bearing)).time_ns) == []
        assert store.newest("U1", bearing) is None
    assert [place.table for place in store.integrity.damaged] == ["series"]


def test_readings_of_a_layout_that_was_altered_are_an_error(store, execute):
    store.append([assessment(speed_rpm=92.3)], [])
    execute("UPDATE layout SET quantities = replace(quantities, 'speed_rpm', 'power_mw')")

    assert store.newest("U1", "UJB") is None
    with pytest.raises(StoreError, match="layout 1 of stored readings"):
        store.trend(query("speed_rpm"))
    assert store.integrity.n_damaged == 1


@pytest.fixture
def access(path: Path) -> Iterator[AccessStore]:
    """Accounts in place of a store."""
    with closing(open_access_file(path)) as opened:
        yield opened


def test_text_that_is_none_stops_no_other_row(access, execute):
    access.accounts.add("A. Name", Role.ADMIN, "hash", 1)
    access.accounts.add("B. Name", Role.VIEWER, "hash", 1)
    execute("UPDATE account SET password_hash = CAST(x'ff80' AS TEXT) WHERE name = 'A. Name'")

    assert [account.name for account in access.accounts.all()] == ["B. Name"]
    assert access.accounts.get("A. Name") is None
    assert access.trouble == "damaged or missing rows: 1"


def test_a_damaged_account_lets_nobody_in_and_nobody_set_up_anew(access, execute):
    access.accounts.add("A. Name", Role.VIEWER, "hash", 1)
    execute("UPDATE account SET role = 'admin'")

    assert access.accounts.get("A. Name") is None
    assert not access.set_up.offer(b"1" * 32, 2**62)


def test_a_reference_that_was_altered_does_not_rule(store, execute):
    source = ReferenceSource.GIVEN
    store.gap_references.add(GapReference("U1", "UJB", 1, "A", (2000.0, 2001.0), None, source, ""))
    execute("DROP TRIGGER gap_reference_kept_as_set")
    execute("UPDATE gap_reference SET x_um = 2100.0")

    assert store.gap_references.in_force() == []
    assert store.gap_references.history("U1", "UJB") == []
    assert store.integrity.n_damaged == 1


def test_seals_hold_after_a_restart_and_go_with_their_rows(path, execute):
    with closing(SqliteStore(path)) as store:
        store.append([assessment(at(n), speed_rpm=float(n)) for n in range(4)], [])
        with store.database.writing() as writer:
            writer.execute("DELETE FROM assessment WHERE time_ns < ?", (at(2),))
            (n_seals,) = writer.execute("SELECT count(*) FROM seal_assessment").fetchone()
    execute(f"UPDATE assessment SET n_segments = 7 WHERE time_ns = {at(3)}")  # noqa: S608
    with closing(SqliteStore(path)) as store:
        assert list(store.trend(query("speed_rpm")).series["speed_rpm"].mean) == [2.0]

    assert n_seals == 2


def test_what_came_from_before_there_were_seals_is_sealed_at_the_upgrade(path, execute):
    with closing(SqliteStore(path)) as store:
        store.append([assessment(speed_rpm=92.3)], [])
    execute("DROP TABLE seal_assessment")
    execute("UPDATE seal_schema SET number = 1")

    with closing(SqliteStore(path)) as store:
        assert list(store.trend(query("speed_rpm")).series["speed_rpm"].mean) == [92.3]
        assert store.integrity.n_damaged == 0


def test_a_schema_whose_names_are_no_text_is_refused_and_found(path):
    SqliteStore(path).close()
    with closing(sqlite3.connect(path)) as other, other:
        other.execute("CREATE TABLE strange (x)")
        other.execute("PRAGMA writable_schema = ON")
        other.execute(
            "UPDATE sqlite_master SET name = CAST(x'd4' AS TEXT), sql = 'nonsense'"
            " WHERE name = 'strange'"
        )

    with pytest.raises(StoreError, match="is damaged: invalid table names"):
        SqliteStore(path)
    assert [finding.kind for finding in findings(path)] == ["structure"]


def test_damage_is_remembered_once_a_place_and_counted_beyond_the_limit():
    log = DamageLog()
    for _ in range(2):
        for n in range(MAX_PLACES):
            log.note(Place("gap", str(n)))
    assert log.n_damaged == len(log.places) == MAX_PLACES

    log.note(Place("gap", "one more"))
    assert (log.n_damaged, len(log.places)) == (MAX_PLACES + 1, MAX_PLACES)


MINUTE_NS, HOUR_NS = 60_000_000_000, 3_600_000_000_000
T0 = 1_767_225_600_000_000_000
N_HOURS = 3
ANY = ValueRange()


@pytest.fixture
def full_store(path: Path) -> Iterator[SqliteStore]:
    """One reading a minute, of as many turns a minute as minutes have passed."""
    with closing(SqliteStore(path)) as opened:
        readings = [
            assessment(T0 + n * MINUTE_NS, speed_rpm=float(n), oil_temperature_c=45.0)
            for n in range(60 * N_HOURS + 1)
        ]
        opened.append(readings, [])
        yield opened


def extremes(full_store: SqliteStore, oil_c: ValueRange = ANY) -> list[tuple[float, float]]:
    """Least and greatest speed of each hour that is gathered."""
    whole = (T0, T0 + N_HOURS * HOUR_NS, N_HOURS + 1, HOUR_NS)
    asked = TrendQuery("U1", "UJB", ("speed_rpm",), *whole, oil_temperature_c=oil_c)
    found = full_store.trend(asked).series["speed_rpm"]
    return list(zip(found.minimum, found.maximum, strict=True))  # type: ignore[arg-type]


def test_a_damaged_reading_is_in_no_roll_up_and_is_counted(full_store, execute):
    for minute in (0, 119):  # in what was not read since it was written
        execute(
            "UPDATE assessment SET reading_values = zeroblob(length(reading_values))"
            " WHERE time_ns = ?",
            (T0 + minute * MINUTE_NS,),
        )

    gather_all(full_store)

    assert full_store.integrity.damaged == [
        Place("assessment", f"series 1, time_ns {T0 + minute * MINUTE_NS}") for minute in (0, 119)
    ]
    assert extremes(full_store) == [(1.0, 59.0), (60.0, 118.0), (120.0, 179.0)]


def test_a_damaged_roll_up_is_not_gathered_into_a_wider_one(full_store, execute):
    gather_all(full_store, T0 + 30 * MINUTE_NS)
    execute("UPDATE rollup_cell SET n_readings = 1 WHERE width_s = 600 AND start_ns = ?", (T0,))

    gather_all(full_store)

    assert [place.table for place in full_store.integrity.damaged] == ["rollup_cell"]
    assert extremes(full_store) == [(10.0, 59.0), (60.0, 119.0), (120.0, 179.0)]


@pytest.mark.parametrize("hour", range(N_HOURS))
def test_numbers_of_a_damaged_cell_are_not_those_of_another_condition(full_store, execute, hour):
    gather_all(full_store)
    right = extremes(full_store)
    execute(
        "UPDATE rollup_cell SET oil_low_c = 1.0 WHERE width_s = 3600 AND start_ns = ?",
        (T0 + hour * HOUR_NS,),
    )

    assert extremes(full_store) == right, "in any condition, and the numbers are intact"
    assert full_store.integrity.damaged == []
    found = extremes(full_store, ValueRange(0.0, 100.0))
    assert [each for each in found if each[0] is not None] == right[:hour] + right[hour + 1 :]
    assert [place.table for place in full_store.integrity.damaged] == ["rollup_cell"]


@pytest.mark.parametrize(
    ("damage", "table"),
    [
        ("UPDATE rollup_cell SET slot = 7", "rollup_cell"),
        ("UPDATE rollup_numbers SET slot = 7", "rollup_numbers"),
        ("UPDATE rollup_numbers SET numbers = zeroblob(length(numbers))", "rollup_numbers"),
    ],
)
@pytest.mark.parametrize("hour", range(N_HOURS))
def test_numbers_and_cells_that_do_not_belong_together_are_in_no_trend(
    full_store, execute, hour, damage, table
):
    gather_all(full_store)
    right = extremes(full_store)
    execute(f"{damage} WHERE width_s = 3600 AND start_ns = ?", (T0 + hour * HOUR_NS,))

    found = [each for each in extremes(full_store) if each[0] is not None]
    assert found == right[:hour] + right[hour + 1 :]
    assert table in {place.table for place in full_store.integrity.damaged}
