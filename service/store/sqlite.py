"""SQLite behind the store's interface: WAL, synchronous=FULL, one writer, short reads."""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from threading import Lock

import numpy as np

from core.account import Gap
from core.assessment import Assessment
from core.quality import Level
from core.quantities import CATALOGUE
from service.origin import Origin
from service.store.buckets import Readings, bucket_width_ns, bucketed, single_points
from service.store.codec import Layout, columns_of
from service.store.gap_reference import GapReference
from service.store.newest import select_newest
from service.store.port import (
    QueryTooLargeError,
    StoredReadings,
    StoreError,
    Trend,
    TrendQuery,
    UnitGap,
)
from service.store.references import insert_reference, select_history, select_in_force
from service.store.schema import migrate

MAX_ROWS = 1_000_000
"""Most readings that one query may touch: about 300 MB of rows and a few seconds."""

BUSY_TIMEOUT_S = 5.0

INSERT_ASSESSMENT = """
    INSERT INTO assessment VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)
    ON CONFLICT (series, time_ns) DO NOTHING
"""
INSERT_GAP = "INSERT INTO gap VALUES (?,?,?,?,?) ON CONFLICT DO NOTHING"
"""Not OR IGNORE, which would silently drop a row that breaks any other rule, too."""

MATCHING = """
    FROM assessment
    WHERE series = (SELECT id FROM series WHERE unit = :unit AND bearing = :bearing)
    AND time_ns >= :start_ns AND time_ns < :end_ns
    AND (:eccentricity_low IS NULL OR eccentricity_ratio >= :eccentricity_low)
    AND (:eccentricity_high IS NULL OR eccentricity_ratio <= :eccentricity_high)
    AND (:oil_low IS NULL OR oil_temperature_c >= :oil_low)
    AND (:oil_high IS NULL OR oil_temperature_c <= :oil_high)
"""
COUNT_ROWS = "SELECT count(*)" + MATCHING
SELECT_ROWS = (
    "SELECT time_ns, layout, reading_values, reading_qualities" + MATCHING + "ORDER BY time_ns"
)


class SqliteStore:
    """One database file; may be used from several threads, writes are taken one at a time.

    Parameters
    ----------
    path
        Created, with its folder, if it does not exist.
    origin
        What it is to hold; a file that holds the other is refused.

    Raises
    ------
    StoreError
        If the file cannot be opened, is not padwatch's, is damaged, or is newer than this program.
    """

    def __init__(self, path: Path, origin: Origin = Origin.LIVE) -> None:
        self._path, self._origin = path, origin
        self._lock = Lock()
        self._layout = Layout.of(columns_of(CATALOGUE))
        with self._renamed_errors():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = sqlite3.connect(
                path, timeout=BUSY_TIMEOUT_S, isolation_level=None, check_same_thread=False
            )
            try:
                self._layout_id = self._prepare()
            except BaseException:
                self._writer.close()
                raise

    def close(self) -> None:
        """Release the file; closing twice is fine."""
        with self._lock:
            self._writer.close()

    def append(self, assessments: Sequence[Assessment], gaps: Sequence[UnitGap]) -> None:
        """Write assessments and gaps in one transaction; durable when this returns.

        Raises
        ------
        StoreError
            If nothing was written; the message is the database's.
        """
        with self._lock, self._renamed_errors(), self._transaction():
            rows = [self._row(assessment) for assessment in assessments]
            self._writer.executemany(INSERT_ASSESSMENT, rows)
            self._writer.executemany(INSERT_GAP, [_gap_row(gap) for gap in gaps])

    def trend(self, query: TrendQuery) -> Trend:
        """Read trends of one bearing, gathered into buckets if they are many."""
        readings = self._readings(query)
        if readings.time_ns.size <= query.max_points:
            return single_points(readings, query.hole_ns)
        start_ns, end_ns = _storable(query.start_ns), _storable(query.end_ns)
        return bucketed(readings, bucket_width_ns(start_ns, end_ns, query.max_points))

    def gaps(self, unit: str, start_ns: int, end_ns: int) -> list[Gap]:
        """Read the recorded gaps whose end lies in a range of time, oldest first."""
        with self._reader() as reader:
            rows = reader.execute(
                "SELECT epoch, first_index, n_samples, stop_ns FROM gap"
                " WHERE unit = ? AND stop_ns >= ? AND stop_ns < ? ORDER BY stop_ns, first_index",
                (unit, _storable(start_ns), _storable(end_ns)),
            )
            return [Gap(*row) for row in rows]

    def newest(self, unit: str, bearing: str) -> StoredReadings | None:
        """Read the newest readings of a bearing; None if there are none."""
        with self._reader() as reader:
            return select_newest(reader, unit, bearing)

    def add_reference(self, reference: GapReference) -> None:
        """Write a reference; durable when this returns.

        Raises
        ------
        StoreError
            If it was not written; the message is the database's.
        """
        with self._lock, self._renamed_errors(), self._transaction():
            insert_reference(self._writer, reference)

    def references(self) -> list[GapReference]:
        """Read the reference that was set last for each bearing that has one."""
        with self._reader() as reader:
            return select_in_force(reader)

    def reference_history(self, unit: str, bearing: str) -> list[GapReference]:
        """Read what was ever set for a bearing, newest first."""
        with self._reader() as reader:
            return select_history(reader, unit, bearing)

    def _row(self, assessment: Assessment) -> tuple[object, ...]:
        values, qualities = self._layout.encode(assessment.readings)
        return (
            self._series_id(assessment.unit, assessment.bearing),
            assessment.time_ns,
            assessment.window.epoch,
            assessment.window.first_index,
            assessment.window.stop_index,
            assessment.window.n_segments,
            assessment.window.coverage,
            assessment.speed_source.value,
            assessment.readings["eccentricity_ratio"].value,
            assessment.readings["oil_temperature_c"].value,
            self._layout_id,
            values,
            qualities,
            assessment.estimators["xx"],
            assessment.estimators["yy"],
        )

    def _series_id(self, unit: str, bearing: str) -> int:
        key = (unit, bearing)
        self._writer.execute(
            "INSERT INTO series (unit, bearing) VALUES (?, ?) ON CONFLICT DO NOTHING", key
        )
        found = self._writer.execute("SELECT id FROM series WHERE unit = ? AND bearing = ?", key)
        return int(found.fetchone()[0])

    def _prepare(self) -> int:
        """Bring the file up to date; return the number of the layout that is written."""
        migrate(
            self._writer, str(self._path), self._origin
        )  # first: a file that is not ours stays as it is
        for setting in ("journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON"):
            self._writer.execute(f"PRAGMA {setting}")
        return self._remember_layout()

    def _remember_layout(self) -> int:
        key = self._layout.dumps()
        with self._transaction():
            self._writer.execute(
                "INSERT INTO layout (quantities, reasons) VALUES (?, ?) ON CONFLICT DO NOTHING", key
            )
        found = self._writer.execute(
            "SELECT id FROM layout WHERE quantities = ? AND reasons = ?", key
        )
        return int(found.fetchone()[0])

    def _readings(self, query: TrendQuery) -> Readings:
        arguments = _arguments(query)
        with self._reader() as reader:
            n_rows = int(reader.execute(COUNT_ROWS, arguments).fetchone()[0])
            if n_rows > MAX_ROWS:
                raise QueryTooLargeError(
                    f"{n_rows} readings in this range, at most {MAX_ROWS} are read at once"
                )
            rows = reader.execute(SELECT_ROWS, arguments).fetchall()
            layouts = {
                id_: Layout.loads(quantities, reasons)
                for id_, quantities, reasons in reader.execute("SELECT * FROM layout")
            }
        return _decoded(rows, layouts, query.quantities)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._writer.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._writer.execute("COMMIT")
        finally:
            # a full disk has rolled back already; a refused commit leaves the transaction open
            if self._writer.in_transaction:
                self._writer.execute("ROLLBACK")

    @contextmanager
    def _reader(self) -> Iterator[sqlite3.Connection]:
        uri = f"{self._path.absolute().as_uri()}?mode=ro"
        with (
            self._renamed_errors(),
            closing(sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT_S)) as reader,
        ):
            yield reader

    @contextmanager
    def _renamed_errors(self) -> Iterator[None]:
        try:
            yield
        except (OSError, sqlite3.Error) as error:
            raise StoreError(f"{self._path}: {error}") from error


def _gap_row(found: UnitGap) -> tuple[object, ...]:
    gap = found.gap
    return (found.unit, gap.epoch, gap.first_index, gap.n_samples, gap.stop_ns)


def _storable(time_ns: int) -> int:
    """The nearest time that a row can have: from 1970 to 2262."""
    return max(0, min(time_ns, 2**63 - 1))


def _arguments(query: TrendQuery) -> dict[str, object]:
    return {
        "unit": query.unit,
        "bearing": query.bearing,
        "start_ns": _storable(query.start_ns),
        "end_ns": _storable(query.end_ns),
        "eccentricity_low": query.eccentricity_ratio.low,
        "eccentricity_high": query.eccentricity_ratio.high,
        "oil_low": query.oil_temperature_c.low,
        "oil_high": query.oil_temperature_c.high,
    }


def _decoded(
    rows: list[tuple[int, int, bytes, bytes]],
    layouts: dict[int, Layout],
    quantities: tuple[str, ...],
) -> Readings:
    time_ns = np.array([row[0] for row in rows], dtype=np.int64)
    layout_of_row = np.array([row[1] for row in rows], dtype=np.int64)
    value = {name: np.full(len(rows), np.nan) for name in quantities}
    level = {name: np.full(len(rows), Level.BAD, dtype=np.uint8) for name in quantities}
    for id_ in np.unique(layout_of_row).tolist():
        layout, where = layouts[id_], np.flatnonzero(layout_of_row == id_)
        numbers, levels = layout.decode([rows[i][2] for i in where], [rows[i][3] for i in where])
        for name in set(quantities) & set(layout.quantities):
            column = layout.quantities.index(name)
            value[name][where] = numbers[:, column]
            level[name][where] = levels[:, column]
    return Readings(time_ns, value, level)
