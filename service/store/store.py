"""Store of all data of a plant, common to SQLite and PostgreSQL."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from core.alarms.alarm import Alarm, AlarmNews
from core.change.film_judge import FilmNews
from core.monitor.assessment import Assessment
from core.samples.gaps import Gap, Reach
from service.settings.storage import SpectraSettings
from service.store.alarms import insert_alarms, select_alarms, select_events
from service.store.audit import AuditChain, AuditStore
from service.store.database import Connection, Database, Hold
from service.store.film_readings import insert_film_news
from service.store.films import FilmStore
from service.store.integrity import Integrity
from service.store.outbox import Address, Outbox, no_recipients
from service.store.port import (
    AlarmQuery,
    QueryTooLargeError,
    StoredEvent,
    StoredReadings,
    Trend,
    TrendQuery,
    UnitGap,
)
from service.store.references import GapReferenceStore, VectorReferenceStore
from service.store.retention import RetentionStore
from service.store.rollups.coverage import read_trend
from service.store.rollups.gathering import RollupStore
from service.store.series import (
    FIXED_COLUMNS,
    Layout,
    other_columns,
    remember_layout,
    series_of,
    unique_time_ns,
)
from service.store.sharing import (
    Commands,
    StreamPosition,
    UnitStates,
    select_position,
    write_positions,
)
from service.store.spectra import SpectraStore, insert_spectra
from service.store.trends import storable
from service.store.waveforms import WaveformStore

MAX_GAPS = 5000
"""Maximum number of gaps that `Store.gaps` returns."""

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
"""Statement that inserts a gap unless it is stored; ``OR IGNORE`` would hide other errors."""

SELECT_GAPS = """
    SELECT epoch, first_index, n_samples, stop_ns, start_ns, is_estimated FROM gap WHERE unit = ?
"""
SELECT_NEWEST = """
    SELECT time_ns, quantities, reasons, reading_values, reading_qualities
    FROM assessment JOIN layout ON layout.id = assessment.layout
    WHERE series = (SELECT id FROM series WHERE unit = ? AND bearing = ?)
    ORDER BY time_ns DESC LIMIT 1
"""
SELECT_LAST = """
    SELECT time_ns, epoch, stop_index FROM assessment
    WHERE series = ? ORDER BY time_ns DESC LIMIT 1
"""


class Store:
    """Store of all data of a plant in one database; may be used from several threads.

    Data are on the disk when the method that writes them returns. All methods raise `StoreError` if
    the database cannot be used.

    Parameters
    ----------
    database
        Open database; closed with the store.
    head
        File with the number and hash of the newest entry of the audit trail.
    address
        Function that returns the outbox messages about an alarm event.
    spectra
        Limits of stored spectra; None for the defaults of `SpectraSettings`.
    is_read_only
        Whether another process writes the database; all methods that write then raise `StoreError`.
    """

    def __init__(
        self,
        database: Database,
        head: Path,
        address: Address = no_recipients,
        spectra: SpectraSettings | None = None,
        *,
        is_read_only: bool = False,
    ) -> None:
        self.database, self._address = database, address
        self._spectra_limits = spectra or SpectraSettings()
        self._chain = AuditChain(head, database)
        self._writing, self._reader = self._chain.writing, database.reading
        audited = (self._chain, self._reader)
        self.audit = AuditStore(*audited)
        self.films = FilmStore(*audited)
        self.gap_references = GapReferenceStore(*audited)
        self.order1_references = VectorReferenceStore(*audited)
        self.outbox = Outbox(self._writing, self._reader)
        self.spectra = SpectraStore(self._writing, self._reader)
        self.rollups = RollupStore(self._writing, self._reader)
        self.retention = RetentionStore(self._writing, self._reader)
        self.unit_states = UnitStates(database.writing, self._reader)
        self.waveforms = WaveformStore(database.writing, self._reader)
        self.commands = Commands(database.writing, self._reader)
        self.integrity = Integrity(self._chain)
        self._layouts: dict[tuple[str, ...], tuple[Layout, int]] = {}
        if not is_read_only:
            self._layout_of(())

    @property
    def kind(self) -> str:
        """Kind of the database: ``sqlite`` or ``postgresql``."""
        return self.database.kind

    def hold(self, name: str) -> AbstractContextManager[Hold]:
        """Return a lock, exclusive among all processes; entering it raises `StoreError` if held."""
        return self.database.hold(name)

    def close(self) -> None:
        """Close the database; closing it twice has no effect."""
        self.database.close()

    def append(
        self,
        assessments: Sequence[Assessment],
        gaps: Sequence[UnitGap],
        alarms: Sequence[AlarmNews] = (),
        films: Sequence[FilmNews] = (),
        positions: Sequence[StreamPosition] = (),
    ) -> None:
        """Write results in one transaction; writing the same results again has no effect.

        Parameters
        ----------
        positions
            Position in the message stream, per unit, up to which the results are complete.

        Raises
        ------
        StoreError
            If the results were not written, or the outcome is unknown.
        """
        layouts = [self._layout_of(other_columns(each.readings)) for each in assessments]
        with self._writing() as writer:
            for assessment, layout in zip(assessments, layouts, strict=True):
                writer.execute(INSERT_ASSESSMENT, self._row(writer, assessment, *layout))
            insert_spectra(writer, assessments, self._spectra_limits)
            writer.executemany(INSERT_GAP, [_gap_row(gap) for gap in gaps])
            insert_alarms(writer, alarms, self._chain, self._address)
            insert_film_news(writer, films)
            write_positions(writer, positions)

    def trend(self, query: TrendQuery) -> Trend:
        """Return the trends of one bearing: a page, or at most ``max_points`` readings or buckets.

        Raises `QueryTooLargeError` if too many single readings would have to be read.
        """
        with self._reader() as reader:
            return read_trend(reader, query)

    def gaps(self, unit: str, start_ns: int, end_ns: int) -> list[Gap]:
        """Return the gaps of a unit that end from `start_ns` to before `end_ns`, oldest first.

        Raises `QueryTooLargeError` if the range has more than `MAX_GAPS` gaps.
        """
        in_range = "AND stop_ns >= ? AND stop_ns < ? ORDER BY stop_ns, first_index LIMIT ?"
        bounds = (unit, storable(start_ns), storable(end_ns), MAX_GAPS + 1)
        with self._reader() as reader:
            found = [_gap(row) for row in reader.execute(f"{SELECT_GAPS} {in_range}", bounds)]
        if len(found) > MAX_GAPS:
            raise QueryTooLargeError(f"more than {MAX_GAPS} gaps; request a shorter time range")
        return found

    def reach(self, unit: str) -> Reach | None:
        """Return the end of a unit's results, with all later gaps; None if nothing was measured."""
        with self._reader() as reader:
            series = reader.execute("SELECT id FROM series WHERE unit = ?", (unit,)).fetchall()
            rows = [reader.execute(SELECT_LAST, row).fetchone() for row in series]
            newest = (tuple(row) for row in rows if row is not None)
            time_ns, epoch, stop_index = max(newest, default=(0, 0, 0))
            if not stop_index:  # a simulated past has no samples
                return None
            beyond = "AND epoch = ? AND first_index >= ? ORDER BY first_index"
            gaps = reader.execute(f"{SELECT_GAPS} {beyond}", (unit, epoch, stop_index))
            return Reach(epoch, stop_index, time_ns, tuple(_gap(row) for row in gaps))

    def newest(self, unit: str, bearing: str) -> StoredReadings | None:
        """Return the newest readings of a bearing; None if the bearing has no readings."""
        with self._reader() as reader:
            row = reader.execute(SELECT_NEWEST, (unit, bearing)).fetchone()
        if row is None:
            return None
        time_ns, quantities, reasons, values, qualities = row
        readings = Layout.loads(quantities, reasons).readings(values, qualities)
        return StoredReadings(int(time_ns), readings)

    def position(self, unit: str) -> StreamPosition | None:
        """Return the stream position of a unit; None if its results never came from a stream."""
        with self._reader() as reader:
            return select_position(reader, unit)

    def alarms(self) -> list[Alarm]:
        """Return the current state of every alarm that has had an event, ordered by alarm id."""
        with self._reader() as reader:
            return select_alarms(reader)

    def alarm_events(self, query: AlarmQuery) -> list[StoredEvent]:
        """Return the alarm events that match a query, newest first."""
        with self._reader() as reader:
            return select_events(reader, query)

    def _layout_of(self, others: tuple[str, ...]) -> tuple[Layout, int]:
        """Return the layout of the fixed and `others` columns, and its stored number."""
        if others not in self._layouts:
            layout = Layout.of((*FIXED_COLUMNS, *others))
            with self.database.writing() as writer:
                self._layouts[others] = layout, remember_layout(writer, layout)
        return self._layouts[others]

    def _row(
        self, writer: Connection, assessment: Assessment, layout: Layout, layout_id: int
    ) -> tuple[object, ...]:
        values, qualities = layout.encode(assessment.readings)
        condition, window = assessment.condition, assessment.window
        series = series_of(writer, assessment.unit, assessment.bearing)
        measured = (window.epoch, window.first_index, window.stop_index)
        return (
            series,
            unique_time_ns(writer, MEASURED_THEN, (series,), assessment.time_ns, measured),
            *measured,
            window.n_segments,
            window.coverage,
            assessment.speed_source.value,
            assessment.readings["eccentricity_ratio"].value,
            assessment.readings["oil_temperature_c"].value,
            layout_id,
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


def _gap(row: tuple[int, int, int, int, int | None, int]) -> Gap:
    return Gap(*row[:-1], is_estimated=bool(row[-1]))
