"""Positions on streams: a row for each unit, written with the results that it tells of."""

from collections.abc import Iterable

from service.store.database import Connection
from service.store.positions_port import StreamPosition

POSITION_TABLES = """
    CREATE TABLE stream_position (
        unit TEXT PRIMARY KEY,
        stream TEXT NOT NULL,
        sequence INTEGER NOT NULL,
        window_sequence INTEGER NOT NULL,
        memory BLOB NOT NULL
    ) STRICT;
"""

WRITE = """
    INSERT INTO stream_position (unit, stream, sequence, window_sequence, memory)
    VALUES (?, ?, ?, ?, ?)
    ON CONFLICT (unit) DO UPDATE SET stream = excluded.stream, sequence = excluded.sequence,
    window_sequence = excluded.window_sequence, memory = excluded.memory
    WHERE stream_position.stream <> excluded.stream
    OR stream_position.sequence < excluded.sequence
"""
"""A position never goes back: who was overtaken writes what is there already."""

READ = "SELECT unit, stream, sequence, window_sequence, memory FROM stream_position WHERE unit = ?"


def write_positions(writer: Connection, positions: Iterable[StreamPosition]) -> None:
    """Write the newest position of each unit, within the transaction of its results."""
    newest = {position.unit: position for position in positions}
    # in one order everywhere, so that two writers never wait for each other
    for _, position in sorted(newest.items()):
        writer.execute(
            WRITE,
            (
                position.unit,
                position.stream,
                position.sequence,
                position.window_sequence,
                position.memory,
            ),
        )


def select_position(reader: Connection, unit: str) -> StreamPosition | None:
    """Read the position of a unit; None if it never had one."""
    row = reader.execute(READ, (unit,)).fetchone()
    if row is None:
        return None
    unit, stream, sequence, window_sequence, memory = row
    return StreamPosition(unit, stream, int(sequence), int(window_sequence), bytes(memory))
