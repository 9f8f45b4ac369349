"""All that a store hands out, row by row, as those who ask it see it."""

import sqlite3
from collections.abc import Mapping
from pathlib import Path

from harness.deeds import T0_NS, Build, deed
from service.store.access.audit_entries import AuditAction
from service.store.access.identities import ApiKey, Role, Session
from service.store.access.tables import AccessStore
from service.store.port import StoreError
from service.store.references import GapReference, ReferenceSource
from service.store.sqlite import SqliteStore
from service.store.sqlite.store import open_access_file

Rows = Mapping[str, frozenset[tuple[object, ...]]]

OTHERS = (
    "INSERT INTO baseline (unit, bearing, estimator, version, created_ns, author, learned_from_ns,"
    " learned_until_ns, event, document) VALUES"
    " ('U9', 'UJB', 'ratio', 1, 5, 'A', 1, 4, 'maintenance', hex(randomblob(6000)))",
    "INSERT INTO baseline_step (unit, bearing, version, step, time_ns, actor, reason)"
    " VALUES ('U9', 'UJB', 1, 'learned', 5, 'padwatch', '')",
    "INSERT INTO shaft_response VALUES ('U9', 5, hex(randomblob(500)))",
    "INSERT INTO simulated_past VALUES (1, 5, 50) ON CONFLICT DO NOTHING",
    "INSERT INTO vector_reference (unit, bearing, state, set_ns, author, note, vectors)"
    " VALUES ('U1', 'UJB', 5, 1, 'A', 'a note', '{\"shaft_x\": [12.5, 30.0]}')",
)
"""Rows that a store takes only from those who can make them."""


WHAT = {"layout": "quantities, reasons"}
"""A store that is opened writes the layout of its rows again where it does not find it."""


def fill(path: Path, seed: int, n_deeds: int, build: Build) -> None:
    """Write something of every kind; the last quarter of it is still in the log."""
    store = SqliteStore(path)
    for number in range(n_deeds):
        deed(seed, number, build).append_to(store)
        if number == n_deeds // 2:
            _others(store)
        if number == 3 * n_deeds // 4:
            store._writer.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    for series in store.rollups.due(T0_NS + 10**15):
        store.rollups.gather(series, T0_NS + 10**15)


def _others(store: SqliteStore) -> None:
    source = ReferenceSource.GIVEN
    for n in range(3):
        gaps = (2000.0 + n, 2001.5)
        store.gap_references.add(
            GapReference("U1", "UJB", T0_NS + n, "A", gaps, None, source, "note")
        )
    store.audit.record(
        [AuditAction(T0_NS + n, "A", "told", "something", after={"n": n}) for n in range(9)]
    )
    with store.database.writing() as writer:
        for statement in OTHERS:
            writer.execute(statement)


def fill_access(path: Path) -> None:
    """Write accounts, sessions and keys; all of it is still in the log."""
    store = open_access_file(path)
    store.accounts.add("A. Name", Role.ADMIN, "$argon2id$" + "x" * 80, T0_NS)
    store.accounts.add("B. Name", Role.VIEWER, "$argon2id$" + "y" * 80, T0_NS)
    store.keys.add(ApiKey("k1", "wall", b"d" * 32, Role.VIEWER, ("U1",), 5, 9, None, None))
    for n in range(9):
        store.sessions.add(Session(bytes([n]) * 32, "A. Name", 5, 6), 1, 0)
        store.audit.record([AuditAction(T0_NS + n, "A", "told", "something", after={"n": n})])


def served(*stores: SqliteStore | AccessStore) -> tuple[Rows, list[str]]:
    """What is in each table for those who read it, and what was refused with an error."""
    rows, errors = {}, []
    for store in stores:
        for table in store.database.seals.tables:
            name = f"{store.audit.chain} {table}"
            try:
                with store.database.reading() as reader:
                    found = reader.execute(f"SELECT {WHAT.get(table, '*')} FROM {table}").fetchall()  # noqa: S608
                rows[name] = frozenset(found)
            except (StoreError, sqlite3.Error) as error:
                errors.append(f"{name}: {error}")
    return rows, errors
