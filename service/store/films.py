"""Film readings, decisions and baselines in the database."""

from collections.abc import Iterable, Mapping, Sequence

from core.arrays import FloatArray
from core.baseline.baseline import BearingBaseline
from core.change.film_judge import FilmNews
from core.change.shaft_response import ShaftResponse
from core.machine.unit import Estimator
from service.store.audit_chain import AuditChain
from service.store.audit_deeds import step_deeds
from service.store.baselines import (
    are_kept,
    insert_baseline,
    insert_steps,
    is_kept,
    select_baseline,
    select_baselines,
    select_responses,
    select_steps,
    set_response,
)
from service.store.database import Connect, Connection
from service.store.film_port import (
    BaselineEntry,
    FilmHistory,
    FilmQuery,
    Provenance,
    StoredDecision,
    StoredStep,
)
from service.store.film_readings import insert_film_news, select_decisions, select_film_history
from service.store.series import Layout, remember_layout, series_of
from service.store.simulated_past import insert_past, select_past_end


class SqlFilms:
    """The film tables of one database.

    Parameters
    ----------
    writing
        Opens a transaction that is durable when left.
    reading
        Opens a connection that only reads.
    audit
        Takes what is done to baselines.
    """

    def __init__(
        self,
        writing: Connect,
        reading: Connect,
        audit: AuditChain,
    ) -> None:
        self._writing, self._reading, self._audit = writing, reading, audit

    def add_simulated(self, readings: Iterable[FilmNews]) -> None:
        """Write readings of a simulation, marked as such."""
        with self._writing() as writer:
            insert_film_news(writer, readings, Provenance.SIMULATED)

    def add_past(
        self,
        unit: str,
        bearing: str,
        estimator: Estimator,
        films: FilmHistory,
        values: Mapping[str, FloatArray],
    ) -> None:
        """Write a bearing's simulated past: readings of its film, and results for its trends."""
        with self._writing() as writer:
            layout = remember_layout(writer, Layout.of(tuple(values)))
            series = series_of(writer, unit, bearing)
            insert_past(writer, series, layout, estimator, films, values)

    def past_end_ns(self, unit: str, bearing: str) -> int | None:
        """Until when a bearing's past is simulated; None if none of it is."""
        with self._reading() as reader:
            return select_past_end(reader, unit, bearing)

    def history(self, query: FilmQuery) -> FilmHistory:
        """Read readings of one film, oldest first."""
        with self._reading() as reader:
            return select_film_history(reader, query)

    def first_ns(self, unit: str, bearing: str, estimator: Estimator) -> int | None:
        """Time of the first reading of a film."""
        with self._reading() as reader:
            found = reader.execute(
                "SELECT min(time_ns) FROM film_reading WHERE estimator = ? AND series ="
                " (SELECT id FROM series WHERE unit = ? AND bearing = ?)",
                (estimator.value, unit, bearing),
            ).fetchone()
        return None if found[0] is None else int(found[0])

    def decisions(self, unit: str, bearing: str) -> list[StoredDecision]:
        """Where the decisions of a bearing stood last."""
        with self._reading() as reader:
            return select_decisions(reader, unit, bearing)

    def add_baseline(self, baseline: BearingBaseline, steps: Sequence[StoredStep]) -> None:
        """Write a learned baseline with what is done with it at once; called again, it is nothing.

        That is for a call whose end nobody could tell.
        """
        with self._writing() as writer:
            if is_kept(writer, baseline) and are_kept(writer, steps):
                return
            insert_baseline(writer, baseline)
            self._add_steps(writer, steps)

    def baselines(self, unit: str, bearing: str) -> list[BaselineEntry]:
        """Every baseline that was ever learned of a bearing, newest first."""
        with self._reading() as reader:
            return select_baselines(reader, unit, bearing)

    def baseline(self, unit: str, bearing: str, version: int) -> BearingBaseline | None:
        """Read one baseline whole."""
        with self._reading() as reader:
            return select_baseline(reader, unit, bearing, version)

    def add_steps(self, steps: Sequence[StoredStep]) -> None:
        """Write what was done to baselines; called again, it is nothing."""
        with self._writing() as writer:
            if are_kept(writer, steps):
                return
            self._add_steps(writer, steps)

    def _add_steps(self, writer: Connection, steps: Sequence[StoredStep]) -> None:
        self._audit.add(writer, step_deeds(writer, steps))
        insert_steps(writer, steps)

    def steps(self, unit: str, bearing: str) -> list[StoredStep]:
        """What was done to the baselines of a bearing, oldest first."""
        with self._reading() as reader:
            return select_steps(reader, unit, bearing)

    def set_response(self, unit: str, response: ShaftResponse, now_ns: int) -> None:
        """Write how a unit's shaft answers to its films."""
        with self._writing() as writer:
            set_response(writer, unit, response, now_ns)

    def responses(self) -> dict[str, ShaftResponse]:
        """How shafts answer, by unit."""
        with self._reading() as reader:
            return select_responses(reader)


DIRECTION_COLUMNS = """
    ln_k_{d} REAL,
    u_random_{d} REAL,
    shaft_um_pk_{d} REAL,
    bearing_um_pk_{d} REAL,
    evidence_{d} INTEGER NOT NULL,
    reason_{d} TEXT NOT NULL,
    verdict_{d} INTEGER NOT NULL,
    level_{d} INTEGER CHECK (level_{d} IN (1, 2)),
    change_{d} REAL,
    change_std_{d} REAL,
    time_scale_h_{d} REAL,
    deviation_{d} REAL,
    deviation_std_{d} REAL,
    cause_{d} TEXT,
    cause_reason_{d} TEXT,
"""
"""Of a reading in one direction, as this schema has them; never edited once released."""

FILM_TABLES = f"""
    ALTER TABLE assessment ADD COLUMN operating_state INTEGER;
    ALTER TABLE assessment ADD COLUMN is_settled INTEGER;
    CREATE TABLE film_reading (
        series INTEGER NOT NULL REFERENCES series (id),
        estimator TEXT NOT NULL,
        time_ns INTEGER NOT NULL,
        provenance TEXT NOT NULL CHECK (provenance IN ('measured', 'simulated')),
        operating_state INTEGER NOT NULL,
        is_settled INTEGER NOT NULL CHECK (is_settled IN (0, 1)),
        speed_rpm REAL,
        power_mw REAL,
        eccentricity_ratio REAL,
        u_eccentricity REAL,
        attitude_deg REAL,
        oil_temperature_c REAL,
        {DIRECTION_COLUMNS.format(d="x")}
        {DIRECTION_COLUMNS.format(d="y")}
        baseline_version INTEGER,
        PRIMARY KEY (series, estimator, time_ns)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE simulated_past (
        series INTEGER PRIMARY KEY REFERENCES series (id),
        start_ns INTEGER NOT NULL,
        end_ns INTEGER NOT NULL
    ) STRICT;
    CREATE TABLE film_decision (
        series INTEGER NOT NULL REFERENCES series (id),
        direction TEXT NOT NULL CHECK (direction IN ('x', 'y')),
        estimator TEXT NOT NULL,
        baseline_version INTEGER,
        document TEXT NOT NULL,
        PRIMARY KEY (series, direction)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE baseline (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        unit TEXT NOT NULL,
        bearing TEXT NOT NULL,
        estimator TEXT NOT NULL,
        version INTEGER NOT NULL CHECK (version > 0),
        created_ns INTEGER NOT NULL,
        author TEXT NOT NULL,
        learned_from_ns INTEGER NOT NULL,
        learned_until_ns INTEGER NOT NULL,
        event TEXT NOT NULL,
        document TEXT NOT NULL,
        UNIQUE (unit, bearing, version)
    ) STRICT;
    CREATE TABLE baseline_step (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        unit TEXT NOT NULL,
        bearing TEXT NOT NULL,
        version INTEGER,
        step TEXT NOT NULL,
        time_ns INTEGER NOT NULL,
        from_ns INTEGER,
        actor TEXT NOT NULL,
        reason TEXT NOT NULL
    ) STRICT;
    CREATE INDEX baseline_step_of ON baseline_step (unit, bearing, id);
    CREATE TABLE shaft_response (
        unit TEXT PRIMARY KEY,
        created_ns INTEGER NOT NULL,
        document TEXT NOT NULL
    ) STRICT, WITHOUT ROWID;
    CREATE TRIGGER baseline_kept_as_learned BEFORE UPDATE ON baseline
    BEGIN SELECT RAISE(ABORT, 'baselines are kept as they were learned'); END;
    CREATE TRIGGER baseline_kept BEFORE DELETE ON baseline
    BEGIN SELECT RAISE(ABORT, 'baselines are kept'); END;
    CREATE TRIGGER baseline_step_kept_as_told BEFORE UPDATE ON baseline_step
    BEGIN SELECT RAISE(ABORT, 'what was done to baselines is kept as it was told'); END;
    CREATE TRIGGER baseline_step_kept BEFORE DELETE ON baseline_step
    BEGIN SELECT RAISE(ABORT, 'what was done to baselines is kept'); END;
"""
"""Statements of the migration that brings them."""
