"""Whatever is done to a stored trail is noticed; an untouched one is whole."""

import random
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from rigs.tiers import first_fast

from service.store.access.audit_entries import AuditAction
from service.store.access.audit_verification import head_path
from service.store.audit import COLUMNS
from service.store.sqlite import SqliteStore
from service.store.sqlite.store import file_trail

N_ENTRIES = 9
NAMES = list(COLUMNS)


class Bench:
    """A trail of nine entries that is damaged and made whole again, over and over."""

    def __init__(self, path: Path) -> None:
        self.path, self.head = path, head_path(path)
        with closing(self.opened()) as database:
            database.execute("PRAGMA journal_mode = DELETE")
            for (name,) in database.execute(
                "SELECT name FROM sqlite_master WHERE type = 'trigger' AND tbl_name = 'audit'"
            ).fetchall():
                database.execute(f"DROP TRIGGER {name}")
        self._database, self._head = path.read_bytes(), self.head.read_bytes()

    def opened(self) -> sqlite3.Connection:
        return sqlite3.connect(self.path, isolation_level=None)

    def repair(self) -> None:
        self.path.write_bytes(self._database)
        self.head.write_bytes(self._head)

    def run(self, corrupt: Callable[[sqlite3.Connection, random.Random], None], seed: int) -> None:
        with closing(self.opened()) as database:
            database.executescript("PRAGMA journal_mode = MEMORY; PRAGMA synchronous = OFF; BEGIN")
            corrupt(database, random.Random(seed))  # noqa: S311
            database.execute("COMMIT")


@pytest.fixture
def bench(path: Path, deed: Callable[..., AuditAction]) -> Bench:
    with closing(SqliteStore(path)) as store:
        store.audit.record([deed(n) for n in range(N_ENTRIES)])
    return Bench(path)


def some(chance: random.Random) -> int:
    return chance.randint(1, N_ENTRIES)


def flip(database: sqlite3.Connection, chance: random.Random) -> None:
    """Turn one bit of one column."""
    name, number = chance.choice(NAMES), some(chance)
    select = f"SELECT {name}, CAST({name} AS BLOB) FROM audit WHERE number = ?"  # noqa: S608
    [(value, raw)] = database.execute(select, (number,))
    changed: object = b"" if value is None else _flipped(raw, chance)
    if isinstance(value, int):
        changed = value ^ (
            1 << (chance.randrange(8, 60) if name == "number" else chance.randrange(60))
        )
    as_text = "CAST(? AS TEXT)" if isinstance(changed, bytes) else "?"
    update = f"UPDATE audit SET {name} = {as_text} WHERE number = ?"  # noqa: S608
    if name == "source":
        changed, update = "padwatch", "UPDATE audit SET source = ? WHERE number = ?"
    database.execute(update, (changed, number))


def _flipped(raw: bytes, chance: random.Random) -> bytes:
    if not raw:
        return b"x"
    at = chance.randrange(len(raw))
    return raw[:at] + bytes([raw[at] ^ (1 << chance.randrange(8))]) + raw[at + 1 :]


def drop(database: sqlite3.Connection, chance: random.Random) -> None:
    database.execute("DELETE FROM audit WHERE number = ?", (some(chance),))


def swap(database: sqlite3.Connection, chance: random.Random) -> None:
    first, second = chance.sample(range(1, N_ENTRIES + 1), 2)
    for number, other in ((first, -1), (second, first), (-1, second)):
        database.execute("UPDATE audit SET number = ? WHERE number = ?", (other, number))


def renumber(database: sqlite3.Connection, chance: random.Random) -> None:
    free = N_ENTRIES + chance.randint(1, 9)
    database.execute("UPDATE audit SET number = ? WHERE number = ?", (free, some(chance)))


def shift(database: sqlite3.Connection, chance: random.Random) -> None:
    """Take one out and close the hole."""
    gone = some(chance)
    database.execute("DELETE FROM audit WHERE number = ?", (gone,))
    for number in range(gone + 1, N_ENTRIES + 1):
        database.execute("UPDATE audit SET number = ? WHERE number = ?", (number - 1, number))


def double(database: sqlite3.Connection, chance: random.Random) -> None:
    """Add an entry once more at the end."""
    rest = ", ".join(NAMES[1:])
    database.execute(
        f"INSERT INTO audit SELECT {N_ENTRIES + 1}, {rest} FROM audit WHERE number = ?",  # noqa: S608
        (some(chance),),
    )


def cut(database: sqlite3.Connection, chance: random.Random) -> None:
    database.execute("DELETE FROM audit WHERE number >= ?", (some(chance),))


KINDS = [flip, flip, flip, drop, swap, renumber, shift, double, cut]


@pytest.mark.parametrize("n_corruptions", first_fast(1, [150, 2000]))
def test_many_ways_to_damage_a_trail_are_all_noticed(bench, n_corruptions):
    assert file_trail(bench.path).verify().is_whole
    unnoticed = []
    for seed in range(n_corruptions):
        chance = random.Random(seed)  # noqa: S311
        kind = chance.choice(KINDS)
        without_head = chance.random() < 0.3
        bench.run(kind, seed)
        if without_head:
            bench.head.unlink()
        if file_trail(bench.path).verify().is_whole:
            unnoticed.append((seed, kind.__name__, without_head))
        bench.repair()
    assert unnoticed == []
    assert file_trail(bench.path).verify().is_whole


@pytest.mark.parametrize("n_bits", first_fast(1, [1, 8]))
def test_every_bit_of_the_head_counts(bench, n_bits):
    whole = bench.head.read_bytes()
    for at in range(len(whole)):
        for bit in ((at + n) % 8 for n in range(n_bits)):
            changed = whole[:at] + bytes([whole[at] ^ (1 << bit)]) + whole[at + 1 :]
            bench.head.write_bytes(changed)
            assert not file_trail(bench.path).verify().is_whole, changed


def finding_after(bench: Bench, statement: str) -> str:
    with closing(bench.opened()) as database:
        database.executescript(statement)
    found = file_trail(bench.path).verify().finding
    assert found is not None
    return found.detail


ALTERED: list[tuple[str, str]] = [
    ("UPDATE audit SET reason = 'other' WHERE number = 4", "entry 4 was altered"),
    ("UPDATE audit SET peer = '' WHERE number = 5", "entry 5 was altered"),
    ("UPDATE audit SET actor = CAST(x'ff' AS TEXT) WHERE number = 5", "entry 5 was altered"),
    ("DELETE FROM audit WHERE number = 4", "entry 4 is missing"),
    ("DELETE FROM audit WHERE number BETWEEN 4 AND 6", "entries 4 to 6 are missing"),
    (
        "DELETE FROM audit WHERE number > 7",
        "entries 8 to 9 are missing at the end: the head file names entry 9",
    ),
    ("DELETE FROM audit", "entries 1 to 9 are missing at the end: the head file names entry 9"),
    (
        "DELETE FROM audit WHERE number = 3; UPDATE audit SET number = 3 WHERE number = 8",
        "entry 3 is out of order; its content is that of entry 8",
    ),
    ("UPDATE audit SET number = 0 WHERE number = 3", "expected entry 1, found entry 0"),
]


def test_the_first_wrong_entry_is_named(bench):
    for statement, expected in ALTERED:
        assert finding_after(bench, statement) == expected
        bench.repair()


def test_a_whole_trail_of_another_database_is_not_taken_for_this_one(bench, tmp_path, deed):
    with closing(SqliteStore(tmp_path / "other.sqlite3")) as other:
        other.audit.record([deed(n, actor="somebody else") for n in range(N_ENTRIES)])
    bench.path.write_bytes((tmp_path / "other.sqlite3").read_bytes())

    found: Any = file_trail(bench.path).verify().finding
    assert found.detail == "entry 9 does not match the hash in the head file"
