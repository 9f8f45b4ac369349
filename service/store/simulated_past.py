"""A simulated past: readings without samples, marked as such, in whole columns."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.history import DIRECTIONS, ReadingOutcome
from core.machine.unit import Estimator
from core.quality import GOOD, Reason, bad
from core.spectra.speed import SpeedSource
from service.store.database import Connection
from service.store.film_port import FilmHistory, Provenance
from service.store.film_readings import COLUMNS, CONDITION_COLUMNS, INSERT
from service.store.series import LEVEL_SHIFT

MEASURED = ("ln_k", "u_random", "shaft_um_pk", "bearing_um_pk")
SAID = ("verdict", "level", "change", "change_std", "deviation", "deviation_std")
INSERT_RESULT = """
    INSERT INTO assessment VALUES (?,?,0,0,0,0,1.0,?,?,?,?,?,?,?,?,?,?)
    ON CONFLICT (series, time_ns) DO NOTHING
"""
MARK = """
    INSERT INTO simulated_past VALUES (:series, :start_ns, :end_ns)
    ON CONFLICT (series) DO UPDATE SET
    start_ns = CASE WHEN excluded.start_ns < simulated_past.start_ns
        THEN excluded.start_ns ELSE simulated_past.start_ns END,
    end_ns = CASE WHEN excluded.end_ns > simulated_past.end_ns
        THEN excluded.end_ns ELSE simulated_past.end_ns END
"""


def insert_past(
    writer: Connection,
    series: int,
    layout: int,
    estimator: Estimator,
    films: FilmHistory,
    values: Mapping[str, FloatArray],
) -> None:
    """Add a bearing's past: readings of its film, and results for its trends.

    Parameters
    ----------
    layout
        Number of the layout of `values`.
    values
        By column of that layout, in its order; (n,) each, NaN where there is no number.
    """
    time_ns = films.history.time_ns
    writer.executemany(INSERT, _film_rows(series, estimator, films))
    writer.executemany(INSERT_RESULT, _result_rows(series, layout, estimator, films, values))
    span = {"series": series, "start_ns": int(time_ns[0]), "end_ns": int(time_ns[-1])}
    writer.execute(MARK, span)


def select_past_end(reader: Connection, unit: str, bearing: str) -> int | None:
    """Until when a bearing's past is simulated; None if none of it is."""
    row = reader.execute(
        "SELECT end_ns FROM simulated_past JOIN series ON series.id = simulated_past.series"
        " WHERE unit = ? AND bearing = ?",
        (unit, bearing),
    ).fetchone()
    return None if row is None else int(row[0])


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
        columns |= {f"{name}_{d}": _numbers(getattr(films.history, name)[row]) for name in MEASURED}
        columns |= {f"{name}_{d}": _numbers(getattr(films, name)[row]) for name in SAID}
        columns[f"evidence_{d}"] = outcome.tolist()
        columns[f"verdict_{d}"] = films.verdict[row].tolist()
        columns[f"level_{d}"] = _nullable(films.level[row], films.level[row] > 0)
        columns[f"reason_{d}"] = [REASONS[code] for code in outcome.tolist()]
    nothing: list[object] = [None] * n
    return list(zip(*(columns.get(name, nothing) for name in COLUMNS), strict=True))


REASONS = {
    ReadingOutcome.MEASURED: Reason.OK.value,
    ReadingOutcome.INSUFFICIENT_EXCITATION: Reason.INSUFFICIENT_EXCITATION.value,
    ReadingOutcome.BAD_QUALITY: Reason.NOT_MEASURED.value,
}


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
            series,
            time_ns,
            source,
            e,
            oil,
            layout,
            row.tobytes(),
            quality.tobytes(),
            name,
            name,
            *its,
        )
        for time_ns, e, oil, *its, row, quality in zip(*columns, numbers, qualities, strict=True)
    ]


def _numbers(column: npt.NDArray[Any]) -> list[object]:
    return _nullable(column, np.isfinite(column))


def _nullable(column: npt.NDArray[Any], is_there: npt.NDArray[np.bool_]) -> list[object]:
    return [
        value if there else None
        for value, there in zip(column.tolist(), is_there.tolist(), strict=True)
    ]
