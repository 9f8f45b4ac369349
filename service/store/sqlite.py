"""SQLite behind the store's interface: WAL, synchronous=FULL, one writer, short reads."""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Lock

from core.account import Gap
from core.alarms.alarm import Alarm
from core.alarms.event import AlarmNews
from core.assessment import Assessment
from core.films.film_judge import FilmNews
from core.quantities import CATALOGUE
from service.audit.head import head_path
from service.origin import Origin
from service.store.access import SqliteAccess
from service.store.alarms import insert_alarms, select_alarms, select_events
from service.store.audit import SqliteAudit
from service.store.audit_chain import AuditChain, begin_head, has_trail
from service.store.audit_deeds import reference_deed
from service.store.codec import Layout, columns_of, remember_layout
from service.store.file_length import why_cut
from service.store.film_readings import insert_film_news
from service.store.films import SqliteFilms
from service.store.gap_reference import GapReference
from service.store.newest import select_newest
from service.store.outbox import SqliteOutbox
from service.store.outbox_port import Address, nobody
from service.store.port import (
    AlarmQuery,
    QueryTooLargeError,
    StoredEvent,
    StoredReadings,
    StoreError,
    Trend,
    TrendQuery,
    UnitGap,
)
from service.store.readers import BUSY_TIMEOUT_S, Readers
from service.store.references import insert_reference, select_history, select_in_force
from service.store.rollups.reading import read_trend
from service.store.rollups.sqlite import SqliteRollups
from service.store.schema import migrate
from service.store.spectra import SqliteSpectra, insert_spectra
from service.store.spectra_port import SpectraLimits
from service.store.trends import storable
from service.store.vector_references import SqliteVectorReferences

MAX_GAPS = 5000
"""Most gaps that are handed out at once."""

PAGE_BYTES = 8192
"""In pages of half that size, a result of all quantities would need a page of its own."""

INSERT_ASSESSMENT = """
    INSERT INTO assessment VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)
    ON CONFLICT (series, time_ns) DO NOTHING
"""
INSERT_GAP = "INSERT INTO gap VALUES (?,?,?,?,?) ON CONFLICT DO NOTHING"
"""Not OR IGNORE, which would silently drop a row that breaks any other rule, too."""


class SqliteStore:
    """One database file; may be used from several threads, writes are taken one at a time.

    Parameters
    ----------
    path
        Created, with its folder, if it does not exist.
    origin
        What it is to hold; a file that holds the other is refused.
    address
        Who is to be told of events of alarms.
    spectra
        How many spectra are kept.

    Raises
    ------
    StoreError
        If the file cannot be opened, is not padwatch's, is damaged, or is newer than this program.
    """

    def __init__(
        self,
        path: Path,
        origin: Origin = Origin.LIVE,
        address: Address = nobody,
        spectra: SpectraLimits | None = None,
    ) -> None:
        self._path, self._origin, self._address = path, origin, address
        self._spectra_limits = spectra or SpectraLimits()
        self._lock = Lock()
        self._readers = Readers(path)
        self.outbox = SqliteOutbox(self._writing, self._reader)
        self._chain = AuditChain(head_path(path))
        self.audit = SqliteAudit(self._writing, self._reader, self._chain)
        self.films = SqliteFilms(self._writing, self._reader, self._series_id, self._chain)
        self.order1_references = SqliteVectorReferences(self._writing, self._reader, self._chain)
        self.spectra = SqliteSpectra(self._reader)
        self.access = SqliteAccess(self._writing, self._reader, self._chain)
        self.rollups = SqliteRollups(self._writing, self._reader)
        self._layout = Layout.of(columns_of(CATALOGUE))
        with self._renamed_errors():
            path.parent.mkdir(parents=True, exist_ok=True)
            if (cut := why_cut(path)) is not None:
                raise StoreError(f"{path}: {cut}")
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
        self._readers.close()  # first: the last to close brings the journal into the file
        with self._lock:
            self._writer.close()

    def append(
        self,
        assessments: Sequence[Assessment],
        gaps: Sequence[UnitGap],
        alarms: Sequence[AlarmNews] = (),
        films: Sequence[FilmNews] = (),
    ) -> None:
        """Write what was found in one transaction; durable when this returns.

        Raises
        ------
        StoreError
            If nothing was written; the message is the database's.
        """
        with self._lock, self._renamed_errors(), self._transaction():
            rows = [self._row(assessment) for assessment in assessments]
            self._writer.executemany(INSERT_ASSESSMENT, rows)
            insert_spectra(self._writer, assessments, self._series_id, self._spectra_limits)
            self._writer.executemany(INSERT_GAP, [_gap_row(gap) for gap in gaps])
            insert_alarms(self._writer, alarms, self._chain.add, self._address)
            insert_film_news(self._writer, films, self._series_id)

    def trend(self, query: TrendQuery) -> Trend:
        """Read trends of one bearing, gathered into buckets if they are many."""
        with self._reader() as reader:
            return read_trend(reader, query)

    def gaps(self, unit: str, start_ns: int, end_ns: int) -> list[Gap]:
        """Read the recorded gaps whose end lies in a range of time, oldest first."""
        with self._reader() as reader:
            rows = reader.execute(
                "SELECT epoch, first_index, n_samples, stop_ns FROM gap"
                " WHERE unit = ? AND stop_ns >= ? AND stop_ns < ? ORDER BY stop_ns, first_index"
                " LIMIT ?",
                (unit, storable(start_ns), storable(end_ns), MAX_GAPS + 1),
            )
            found = [Gap(*row) for row in rows]
        if len(found) > MAX_GAPS:
            raise QueryTooLargeError(f"more than {MAX_GAPS} gaps: ask for a shorter time")
        return found

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
            self._chain.add(self._writer, [reference_deed(self._writer, reference)])
            insert_reference(self._writer, reference)

    def references(self) -> list[GapReference]:
        """Read the reference that was set last for each bearing that has one."""
        with self._reader() as reader:
            return select_in_force(reader)

    def reference_history(self, unit: str, bearing: str) -> list[GapReference]:
        """Read what was ever set for a bearing, newest first."""
        with self._reader() as reader:
            return select_history(reader, unit, bearing)

    def alarms(self) -> list[Alarm]:
        """Read every alarm that ever had an event, as it was after its newest."""
        with self._reader() as reader:
            return select_alarms(reader)

    def alarm_events(self, query: AlarmQuery) -> list[StoredEvent]:
        """Read events of alarms, newest first."""
        with self._reader() as reader:
            return select_events(reader, query)

    def _row(self, assessment: Assessment) -> tuple[object, ...]:
        values, qualities = self._layout.encode(assessment.readings)
        condition = assessment.condition
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
            None if condition is None else int(condition.state),
            None if condition is None else int(condition.is_settled),
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
        self._writer.execute(f"PRAGMA page_size = {PAGE_BYTES}")  # of a file yet to be written
        had_trail = has_trail(self._writer)
        migrate(
            self._writer, str(self._path), self._origin
        )  # first: a file that is not ours stays as it is
        if not had_trail:
            begin_head(head_path(self._path))
        for setting in ("journal_mode = WAL", "synchronous = FULL", "foreign_keys = ON"):
            self._writer.execute(f"PRAGMA {setting}")
        with self._transaction():
            return remember_layout(self._writer, self._layout)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._writer.execute("BEGIN IMMEDIATE")
        self._chain.begin()
        try:
            yield
            self._writer.execute("COMMIT")
            self._chain.settle(self._writer)
        finally:
            # a full disk has rolled back already; a refused commit leaves the transaction open
            if self._writer.in_transaction:
                self._writer.execute("ROLLBACK")

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        with self._lock, self._renamed_errors(), self._transaction():
            yield self._writer

    @contextmanager
    def _reader(self) -> Iterator[sqlite3.Connection]:
        with self._renamed_errors(), self._readers.reading() as reader:
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
