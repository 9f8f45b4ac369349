"""The store in SQL, over one of two databases."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from core.alarms.alarm import Alarm, AlarmNews
from core.change.film_judge import FilmNews
from core.monitor.assessment import Assessment
from core.monitor.catalogue import CATALOGUE
from core.samples.gaps import Gap, Reach
from service.store.access.tables import SqlAccess
from service.store.alarms import insert_alarms, select_alarms, select_events
from service.store.audit import SqlAudit
from service.store.audit_chain import AuditChain
from service.store.audit_deeds import reference_deed
from service.store.database import Connection, Database, Hold
from service.store.film_readings import insert_film_news
from service.store.films import SqlFilms
from service.store.gap_reference import GapReference
from service.store.integrity_port import Integrity, Unmarked
from service.store.moments import free_moment
from service.store.outbox import Address, SqlOutbox, no_recipients
from service.store.port import (
    AlarmQuery,
    QueryTooLargeError,
    StoredEvent,
    StoredReadings,
    Trend,
    TrendQuery,
    UnitGap,
)
from service.store.references import insert_reference, is_set, select_history, select_in_force
from service.store.results import gap_of, select_newest, select_reach
from service.store.retention.sql import SqlRetention
from service.store.rollups.coverage import read_trend
from service.store.rollups.gathering import SqlRollups
from service.store.series import Layout, columns_of, remember_layout, series_of
from service.store.sharing import (
    StoredCommands,
    StoredUnitStates,
    StreamPosition,
    select_position,
    write_positions,
)
from service.store.spectra import SqlSpectra, insert_spectra
from service.store.spectra_port import SpectraLimits
from service.store.trends import storable
from service.store.vector_references import SqlVectorReferences
from service.store.waveforms import StoredWaveforms

MAX_GAPS = 5000
"""Most gaps that are handed out at once."""

INSERT_ASSESSMENT = """
    INSERT INTO assessment VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)
    ON CONFLICT (series, time_ns) DO NOTHING
"""
MEASURED_THEN = """
    SELECT epoch, first_index, stop_index FROM assessment WHERE series = ? AND time_ns = ?
"""
INSERT_GAP = """
    INSERT INTO gap (unit, epoch, first_index, n_samples, stop_ns, start_ns, is_estimated)
    VALUES (?,?,?,?,?,?,?) ON CONFLICT DO NOTHING
"""
"""Not OR IGNORE, which would silently drop a row that breaks any other rule, too."""


class SqlStore:
    """The store over a database; may be used from several threads.

    Parameters
    ----------
    database
        Open; closed with the store.
    head
        File that names the newest entry of the audit trail.
    address
        Who is to be told of events of alarms.
    spectra
        How many spectra are kept.
    """

    def __init__(
        self,
        database: Database,
        head: Path,
        address: Address = no_recipients,
        spectra: SpectraLimits | None = None,
    ) -> None:
        self.database, self._address = database, address
        self._spectra_limits = spectra or SpectraLimits()
        self._chain = AuditChain(head, database)
        self._writing, self._reader = self._chain.writing, database.reading
        self.outbox = SqlOutbox(self._writing, self._reader)
        self.audit = SqlAudit(self._writing, self._reader, self._chain)
        self.films = SqlFilms(self._writing, self._reader, self._chain)
        self.order1_references = SqlVectorReferences(self._writing, self._reader, self._chain)
        self.spectra = SqlSpectra(self._reader)
        self.integrity: Integrity = Unmarked()
        self.access = SqlAccess(self._writing, self._reader, self._chain)
        self.rollups = SqlRollups(self._writing, self._reader)
        self.retention = SqlRetention(self._writing, self._reader)
        self.unit_states = StoredUnitStates(database.writing, self._reader)
        self.waveforms = StoredWaveforms(database.writing, self._reader)
        self.commands = StoredCommands(database.writing, self._reader)
        self._layout = Layout.of(columns_of(CATALOGUE))
        with database.writing() as writer:
            self._layout_id = remember_layout(writer, self._layout)

    @property
    def kind(self) -> str:
        """``sqlite`` or ``postgresql``."""
        return self.database.kind

    def hold(self, name: str) -> AbstractContextManager[Hold]:
        """Take a name among all processes that use the database; see `Database.hold`."""
        return self.database.hold(name)

    def close(self) -> None:
        """Release the database; closing twice is fine."""
        self.database.close()

    def append(
        self,
        assessments: Sequence[Assessment],
        gaps: Sequence[UnitGap],
        alarms: Sequence[AlarmNews] = (),
        films: Sequence[FilmNews] = (),
        positions: Sequence[StreamPosition] = (),
    ) -> None:
        """Write what was found in one transaction; durable when this returns.

        Raises
        ------
        StoreError
            If nothing was written; the message is the database's.
        """
        with self._writing() as writer:
            for assessment in assessments:
                writer.execute(INSERT_ASSESSMENT, self._row(writer, assessment))
            insert_spectra(writer, assessments, self._spectra_limits)
            writer.executemany(INSERT_GAP, [_gap_row(gap) for gap in gaps])
            insert_alarms(writer, alarms, self._chain.add, self._address)
            insert_film_news(writer, films)
            write_positions(writer, positions)

    def trend(self, query: TrendQuery) -> Trend:
        """Read trends of one bearing, gathered into buckets if they are many."""
        with self._reader() as reader:
            return read_trend(reader, query)

    def gaps(self, unit: str, start_ns: int, end_ns: int) -> list[Gap]:
        """Read the recorded gaps whose end lies in a range of time, oldest first."""
        with self._reader() as reader:
            rows = reader.execute(
                "SELECT epoch, first_index, n_samples, stop_ns, start_ns, is_estimated FROM gap"
                " WHERE unit = ? AND stop_ns >= ? AND stop_ns < ? ORDER BY stop_ns, first_index"
                " LIMIT ?",
                (unit, storable(start_ns), storable(end_ns), MAX_GAPS + 1),
            )
            found = [gap_of(row) for row in rows]
        if len(found) > MAX_GAPS:
            raise QueryTooLargeError(f"more than {MAX_GAPS} gaps: ask for a shorter time")
        return found

    def reach(self, unit: str) -> Reach | None:
        """Up to where the stored results of a unit reach; None if there are none."""
        with self._reader() as reader:
            return select_reach(reader, unit)

    def newest(self, unit: str, bearing: str) -> StoredReadings | None:
        """Read the newest readings of a bearing; None if there are none."""
        with self._reader() as reader:
            return select_newest(reader, unit, bearing)

    def add_reference(self, reference: GapReference) -> None:
        """Write a reference; durable when this returns, and there once if it is called again.

        Raises
        ------
        StoreError
            If it was not written, or nobody can tell; the message is the database's.
        """
        with self._writing() as writer:
            if is_set(writer, reference):
                return
            self._chain.add(writer, [reference_deed(writer, reference)])
            insert_reference(writer, reference)

    def references(self) -> list[GapReference]:
        """Read the reference that was set last for each bearing that has one."""
        with self._reader() as reader:
            return select_in_force(reader)

    def reference_history(self, unit: str, bearing: str) -> list[GapReference]:
        """Read what was ever set for a bearing, newest first."""
        with self._reader() as reader:
            return select_history(reader, unit, bearing)

    def position(self, unit: str) -> StreamPosition | None:
        """How far the results of a unit reach on a stream; None if they never came from one."""
        with self._reader() as reader:
            return select_position(reader, unit)

    def alarms(self) -> list[Alarm]:
        """Read every alarm that ever had an event, as it was after its newest."""
        with self._reader() as reader:
            return select_alarms(reader)

    def alarm_events(self, query: AlarmQuery) -> list[StoredEvent]:
        """Read events of alarms, newest first."""
        with self._reader() as reader:
            return select_events(reader, query)

    def _row(self, writer: Connection, assessment: Assessment) -> tuple[object, ...]:
        values, qualities = self._layout.encode(assessment.readings)
        condition, window = assessment.condition, assessment.window
        series = series_of(writer, assessment.unit, assessment.bearing)
        measured = (window.epoch, window.first_index, window.stop_index)
        return (
            series,
            free_moment(writer, MEASURED_THEN, (series,), assessment.time_ns, measured),
            *measured,
            window.n_segments,
            window.coverage,
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


def _gap_row(found: UnitGap) -> tuple[object, ...]:
    gap = found.gap
    counted = (found.unit, gap.epoch, gap.first_index, gap.n_samples, gap.stop_ns)
    return (*counted, gap.start_ns, int(gap.is_estimated))
