"""Film readings: one row for each reading, one column for each number."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from core.baseline.history import DIRECTIONS, StiffnessHistory
from core.change.film_judge import FilmFinding, FilmNews
from core.change.film_reading import FilmValue
from core.machine.unit import Estimator
from service.store.database import Connection
from service.store.documents import decision_from_json, to_json
from service.store.film_port import FilmHistory, FilmQuery, Provenance, StoredDecision
from service.store.moments import free_moment
from service.store.port import StoreError
from service.store.series import series_of
from service.store.trends import BETWEEN_BOUNDS, IN_STATES, condition_arguments

CONDITION_COLUMNS = (
    *("speed_rpm", "power_mw", "eccentricity_ratio", "u_eccentricity"),
    *("attitude_deg", "oil_temperature_c"),
)
VALUE_COLUMNS = ("ln_k", "u_random", "shaft_um_pk", "bearing_um_pk", "evidence", "reason")
FINDING_COLUMNS = (
    *("verdict", "level", "change", "change_std", "time_scale_h"),
    *("deviation", "deviation_std", "cause", "cause_reason"),
)
COLUMNS = (
    *("series", "estimator", "time_ns", "provenance", "operating_state", "is_settled"),
    *CONDITION_COLUMNS,
    *(f"{name}_{d}" for d in DIRECTIONS for name in (*VALUE_COLUMNS, *FINDING_COLUMNS)),
    "baseline_version",
)
INSERT = (
    f"INSERT INTO film_reading ({', '.join(COLUMNS)})"  # noqa: S608
    f" VALUES ({', '.join('?' * len(COLUMNS))})"
    " ON CONFLICT (series, estimator, time_ns) DO NOTHING"
)
MEASURED_THEN = f"""
    SELECT {", ".join(CONDITION_COLUMNS)} FROM film_reading
    WHERE series = ? AND estimator = ? AND time_ns = ?
"""  # noqa: S608
REMEMBER = """
    INSERT INTO film_decision VALUES (?, ?, ?, ?, ?)
    ON CONFLICT (series, direction) DO UPDATE SET
    estimator = excluded.estimator, baseline_version = excluded.baseline_version,
    document = excluded.document
"""
READ_NUMBERS = (
    *("time_ns", "operating_state", "is_settled", *CONDITION_COLUMNS, "baseline_version"),
    *(
        f"{name}_{d}"
        for name in (
            "ln_k",
            "u_random",
            "shaft_um_pk",
            "bearing_um_pk",
            "evidence",
            "verdict",
            "level",
            "change",
            "change_std",
            "deviation",
            "deviation_std",
        )
        for d in DIRECTIONS
    ),
)
"""Columns that are read back into arrays."""

SELECT = f"""
    SELECT {", ".join(READ_NUMBERS)}, provenance FROM film_reading
    WHERE series = (SELECT id FROM series WHERE unit = :unit AND bearing = :bearing)
    AND estimator = :estimator AND time_ns >= :start_ns AND time_ns < :end_ns
    AND {IN_STATES}
    AND {BETWEEN_BOUNDS}
    ORDER BY time_ns DESC LIMIT :newest
"""  # noqa: S608


def insert_film_news(
    writer: Connection,
    news: Iterable[FilmNews],
    provenance: Provenance = Provenance.MEASURED,
) -> None:
    """Add readings, and note where their decisions stand."""
    for told in news:
        reading = told.reading
        series = series_of(writer, reading.unit, reading.bearing)
        writer.execute(INSERT, _row(writer, series, told, provenance))
        for direction, finding, decision in zip(
            DIRECTIONS, told.findings, told.decisions, strict=True
        ):
            document = to_json(decision)
            version = finding.baseline_version
            writer.execute(REMEMBER, (series, direction, reading.estimator, version, document))


def _row(
    writer: Connection, series: int, news: FilmNews, provenance: Provenance
) -> tuple[object, ...]:
    reading = news.reading
    key = (series, reading.estimator.value)
    measured = tuple(_or_null(getattr(reading, name)) for name in CONDITION_COLUMNS)
    return (
        *(*key, free_moment(writer, MEASURED_THEN, key, reading.time_ns, measured)),
        provenance.value,
        *(int(reading.condition.state), int(reading.condition.is_settled)),
        *measured,
        *(
            cell
            for value, finding in zip(reading.values, news.findings, strict=True)
            for cell in (*_value_cells(value), *_finding_cells(finding))
        ),
        news.findings[0].baseline_version,
    )


def _value_cells(value: FilmValue) -> tuple[object, ...]:
    numbers = (value.ln_k, value.u_random, value.shaft_um_pk, value.bearing_um_pk)
    return (*(_or_null(number) for number in numbers), int(value.outcome), value.reason.value)


def _finding_cells(finding: FilmFinding) -> tuple[object, ...]:
    attribution = finding.attribution
    return (
        *(int(finding.verdict), finding.level, finding.change, finding.change_std),
        *(finding.time_scale_h, finding.deviation, finding.deviation_std),
        *((attribution.cause.value, attribution.reason) if attribution else (None, None)),
    )


def _or_null(value: float) -> float | None:
    return None if math.isnan(value) else value


def select_decisions(reader: Connection, unit: str, bearing: str) -> list[StoredDecision]:
    """Where the decisions of a bearing stood last.

    Raises
    ------
    StoreError
        If one of them cannot be read.
    """
    rows = reader.execute(
        "SELECT direction, estimator, baseline_version, document FROM film_decision"
        " JOIN series ON series.id = film_decision.series WHERE unit = ? AND bearing = ?"
        " ORDER BY direction",
        (unit, bearing),
    )
    try:
        return [
            StoredDecision(
                direction,
                Estimator(estimator),
                version,
                decision_from_json(document),
            )
            for direction, estimator, version, document in rows
        ]
    except ValueError as error:
        raise StoreError(f"a decision of unit {unit} bearing {bearing}: {error}") from error


def select_film_history(reader: Connection, query: FilmQuery) -> FilmHistory:
    """Readings of one film, oldest first."""
    rows = reader.execute(SELECT, _arguments(query)).fetchall()[::-1]
    numbers = np.array([row[:-1] for row in rows], dtype=np.float64)
    column = dict(zip(READ_NUMBERS, numbers.reshape(-1, len(READ_NUMBERS)).T, strict=True))
    time_ns = np.array([row[0] for row in rows], dtype=np.int64)  # not through a float
    return _history(time_ns, column, np.array([row[-1] == Provenance.SIMULATED for row in rows]))


def _arguments(query: FilmQuery) -> dict[str, Any]:
    return {
        "unit": query.unit,
        "bearing": query.bearing,
        "estimator": query.estimator.value,
        "start_ns": max(0, min(query.start_ns, 2**63 - 1)),
        "end_ns": max(0, min(query.end_ns, 2**63 - 1)),
        **condition_arguments(query.states, query.eccentricity_ratio, query.oil_temperature_c),
        "newest": 2**63 - 1 if query.newest is None else query.newest,
    }


def _history(
    time_ns: npt.NDArray[np.int64],
    column: dict[str, npt.NDArray[np.float64]],
    is_simulated: npt.NDArray[np.bool_],
) -> FilmHistory:
    def pair(name: str) -> npt.NDArray[np.float64]:
        return np.stack([column[f"{name}_{direction}"] for direction in DIRECTIONS])

    def codes(values: npt.NDArray[np.float64]) -> npt.NDArray[np.int8]:
        return np.nan_to_num(values).astype(np.int8)

    return FilmHistory(
        history=StiffnessHistory(
            time_ns=time_ns,
            **{name: column[name] for name in CONDITION_COLUMNS},
            ln_k=pair("ln_k"),
            u_random=pair("u_random"),
            shaft_um_pk=pair("shaft_um_pk"),
            bearing_um_pk=pair("bearing_um_pk"),
            outcome=codes(pair("evidence")),
        ),
        state=codes(column["operating_state"]),
        is_settled=column["is_settled"] > 0.0,
        is_simulated=is_simulated.astype(np.bool_),
        verdict=codes(pair("verdict")),
        level=codes(pair("level")),
        change=pair("change"),
        change_std=pair("change_std"),
        deviation=pair("deviation"),
        deviation_std=pair("deviation_std"),
        baseline_version=np.nan_to_num(column["baseline_version"]).astype(np.int64),
    )
