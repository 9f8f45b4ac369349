"""Store of oil films: readings, decisions, baselines and simulated past results."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.history import DIRECTIONS, QUANTITIES, ReadingOutcome
from core.change.film_judge import FilmNews
from core.machine.unit import Estimator
from core.quality import GOOD, Reason, bad
from core.spectra.speed import SpeedSource
from service.store.baselines import BaselineTables
from service.store.film_readings import (
    CHANGE_COLUMNS,
    COLUMNS,
    CONDITION_COLUMNS,
    INSERT,
    MEASURED_COLUMNS,
    FilmHistory,
    FilmQuery,
    Provenance,
    StoredDecision,
    insert_film_news,
    select_decisions,
    select_film_history,
)
from service.store.series import LEVEL_SHIFT, Layout, remember_layout, series_of

INSERT_RESULT = """
    INSERT INTO assessment VALUES (?,?,0,0,0,0,1.0,?,?,?,?,?,?,?,?,?,?)
    ON CONFLICT (series, time_ns) DO NOTHING
"""
MARK_PAST = """
    INSERT INTO simulated_past VALUES (:series, :start_ns, :end_ns)
    ON CONFLICT (series) DO UPDATE SET
    start_ns = CASE WHEN excluded.start_ns < simulated_past.start_ns
        THEN excluded.start_ns ELSE simulated_past.start_ns END,
    end_ns = CASE WHEN excluded.end_ns > simulated_past.end_ns
        THEN excluded.end_ns ELSE simulated_past.end_ns END
"""
REASONS = {
    ReadingOutcome.MEASURED: Reason.OK.value,
    ReadingOutcome.INSUFFICIENT_EXCITATION: Reason.INSUFFICIENT_EXCITATION.value,
    ReadingOutcome.BAD_QUALITY: Reason.NOT_MEASURED.value,
}


class FilmStore(BaselineTables):
    """Store of film readings, decisions and baselines; changes are on the disk on return."""

    def add_simulated(self, readings: Iterable[FilmNews]) -> None:
        """Write simulated film readings, with the provenance "simulated"."""
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
        """Write simulated past data of a bearing; results that are already stored are kept.

        Parameters
        ----------
        films
            At least one film reading, in ascending order of time.
        values
            Trend values by column name, shape (n,) for n film readings; NaN for missing values.
        """
        time_ns = films.history.time_ns
        with self._writing() as writer:
            layout = remember_layout(writer, Layout.of(tuple(values)))
            series = series_of(writer, unit, bearing)
            writer.executemany(INSERT, _film_rows(series, estimator, films))
            rows = _result_rows(series, layout, estimator, films, values)
            writer.executemany(INSERT_RESULT, rows)
            span = {"series": series, "start_ns": int(time_ns[0]), "end_ns": int(time_ns[-1])}
            writer.execute(MARK_PAST, span)

    def past_end_ns(self, unit: str, bearing: str) -> int | None:
        """Return the end, ns since 1970 UTC, of a bearing's simulated past; None without a past."""
        with self._reading() as reader:
            row = reader.execute(
                "SELECT end_ns FROM simulated_past JOIN series ON series.id = simulated_past.series"
                " WHERE unit = ? AND bearing = ?",
                (unit, bearing),
            ).fetchone()
        return None if row is None else int(row[0])

    def history(self, query: FilmQuery) -> FilmHistory:
        """Return the readings of one film that match a query, oldest first."""
        with self._reading() as reader:
            return select_film_history(reader, query)

    def first_ns(self, unit: str, bearing: str, estimator: Estimator) -> int | None:
        """Return the time, ns since 1970 UTC, of a film's first reading; None without readings."""
        with self._reading() as reader:
            found = reader.execute(
                "SELECT min(time_ns) FROM film_reading WHERE estimator = ? AND series ="
                " (SELECT id FROM series WHERE unit = ? AND bearing = ?)",
                (estimator.value, unit, bearing),
            ).fetchone()
        return None if found[0] is None else int(found[0])

    def decisions(self, unit: str, bearing: str) -> list[StoredDecision]:
        """Return the stored decisions on the film of a bearing, in the order of `QUANTITIES`.

        Raises `StoreError` if a stored decision is invalid.
        """
        with self._reading() as reader:
            return select_decisions(reader, unit, bearing)


def _film_rows(series: int, estimator: Estimator, films: FilmHistory) -> list[tuple[object, ...]]:
    n = len(films)
    columns: dict[str, list[object]] = {
        "series": [series] * n,
        "estimator": [estimator.value] * n,
        "time_ns": films.history.time_ns.tolist(),
        "provenance": [Provenance.SIMULATED.value] * n,
        "operating_state": films.state.tolist(),
        "is_settled": films.is_settled.astype(int).tolist(),
        "baseline_version": _nullable(films.baseline_version, films.baseline_version > 0),
    }
    for name in CONDITION_COLUMNS:
        columns[name] = _numbers(getattr(films.history, name))
    for row, d in enumerate(DIRECTIONS):
        outcome = films.history.outcome[row]
        for name in MEASURED_COLUMNS:
            columns[f"{name}_{d}"] = _numbers(getattr(films.history, name)[row])
        columns[f"evidence_{d}"] = outcome.tolist()
        columns[f"reason_{d}"] = [REASONS[code] for code in outcome.tolist()]
    for row, name in enumerate(QUANTITIES):
        for change in CHANGE_COLUMNS:
            columns[f"{change}_{name}"] = _numbers(getattr(films, change)[row])
        columns[f"verdict_{name}"] = films.verdict[row].tolist()
        columns[f"level_{name}"] = _nullable(films.level[row], films.level[row] > 0)
    nothing: list[object] = [None] * n
    return list(zip(*(columns.get(name, nothing) for name in COLUMNS), strict=True))


def _result_rows(
    series: int,
    layout: int,
    estimator: Estimator,
    films: FilmHistory,
    values: Mapping[str, FloatArray],
) -> list[tuple[object, ...]]:
    numbers = np.stack(list(values.values()), axis=1).astype("<f8")
    reasons = [reason.value for reason in Reason]
    good, missing = (
        quality.level << LEVEL_SHIFT | reasons.index(quality.reason.value)
        for quality in (GOOD, bad(Reason.NOT_MEASURED))
    )
    qualities = np.where(np.isfinite(numbers), good, missing).astype(np.uint8)
    history = films.history
    columns = (
        history.time_ns.tolist(),
        _numbers(history.eccentricity_ratio),
        _numbers(history.oil_temperature_c),
        films.state.tolist(),
        films.is_settled.astype(int).tolist(),
    )
    source, name = SpeedSource.SLOW_CHANNEL.value, estimator.value
    return [
        (
            *(series, time_ns, source, e, oil, layout),
            *(row.tobytes(), quality.tobytes(), name, name, *condition),
        )
        for time_ns, e, oil, *condition, row, quality in zip(
            *columns, numbers, qualities, strict=True
        )
    ]


def _numbers(column: npt.NDArray[Any]) -> list[object]:
    return _nullable(column, np.isfinite(column))


def _nullable(column: npt.NDArray[Any], is_known: npt.NDArray[np.bool_]) -> list[object]:
    return [
        value if known else None
        for value, known in zip(column.tolist(), is_known.tolist(), strict=True)
    ]


DIRECTION_COLUMNS = """
    ln_k_{d} REAL,
    u_random_{d} REAL,
    shaft_um_pk_{d} REAL,
    bearing_um_pk_{d} REAL,
    ln_ck_{d} REAL,
    u_ck_{d} REAL,
    shaft_phase_deg_{d} REAL,
    bearing_phase_deg_{d} REAL,
    evidence_{d} INTEGER NOT NULL,
    reason_{d} TEXT NOT NULL,
"""
FINDING_COLUMNS = """
    verdict_{q} INTEGER NOT NULL,
    level_{q} INTEGER CHECK (level_{q} IN (1, 2)),
    change_{q} REAL,
    change_std_{q} REAL,
    time_scale_h_{q} REAL,
    deviation_{q} REAL,
    deviation_std_{q} REAL,
    cause_{q} TEXT,
    cause_reason_{q} TEXT,
"""
"""SQL columns of a film reading for a direction, and for a quantity, created by this migration."""

FILM_TABLES = f"""
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
        {"".join(DIRECTION_COLUMNS.format(d=d) for d in DIRECTIONS)}
        {"".join(FINDING_COLUMNS.format(q=q) for q in QUANTITIES)}
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
        quantity TEXT NOT NULL,
        estimator TEXT NOT NULL,
        baseline_version INTEGER,
        document TEXT NOT NULL,
        PRIMARY KEY (series, quantity)
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
    BEGIN SELECT RAISE(ABORT, 'steps of baselines are kept as they were written'); END;
    CREATE TRIGGER baseline_step_kept BEFORE DELETE ON baseline_step
    BEGIN SELECT RAISE(ABORT, 'steps of baselines are kept'); END;
"""
"""Migration that creates the tables of film readings, decisions, baselines and shaft responses."""
