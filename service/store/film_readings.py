"""Tables of the stiffness readings of oil films and of the decisions on the films."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.history import DIRECTIONS, QUANTITIES, CodeArray, StiffnessHistory
from core.change.decision import Decision
from core.change.film_judge import FilmFinding, FilmNews
from core.change.film_reading import FilmValue
from core.condition.operating_state import OperatingState
from core.machine.unit import Estimator
from service.store.database import Connection, insert, upsert
from service.store.documents import from_json, to_json
from service.store.port import StoreError, ValueRange
from service.store.series import series_of, unique_time_ns
from service.store.trends import BETWEEN_BOUNDS, IN_STATES, condition_arguments, storable


class Provenance(StrEnum):
    """Origin of film readings: measured from samples, or simulated without samples."""

    MEASURED = "measured"
    SIMULATED = "simulated"


@dataclass(frozen=True)
class FilmQuery:
    """Query for readings of a film, oldest first.

    Parameters
    ----------
    start_ns, end_ns
        Half-open time range, ns since 1970 UTC.
    states
        Operating states to include; empty for all.
    newest
        Maximum number of readings; older matching readings are omitted. None for all.
    """

    unit: str
    bearing: str
    estimator: Estimator
    start_ns: int = 0
    end_ns: int = 2**63 - 1
    states: tuple[OperatingState, ...] = ()
    eccentricity_ratio: ValueRange = field(default_factory=ValueRange)
    oil_temperature_c: ValueRange = field(default_factory=ValueRange)
    newest: int | None = None


@dataclass(frozen=True, eq=False)
class FilmHistory:
    """Readings of one film at n times, with the results of the change detection.

    Parameters
    ----------
    state : (n,)
        Numbers of `OperatingState`.
    is_settled, is_simulated : (n,)
        Whether the operating condition was settled, and whether the reading is simulated.
    verdict, level : (4, n)
        Numbers of `Verdict`, and of `AlarmLevel` (0 for no alarm); one row per quantity in the
        order of `QUANTITIES`.
    change, change_std : (4, n)
        Mean deviation from the baseline, in ln, over the averaging time for which it is most
        significant, and its standard uncertainty; NaN if unknown.
    deviation, deviation_std : (4, n)
        Deviation of the reading from the baseline, in ln, and its standard uncertainty; NaN if
        unknown.
    baseline_version : (n,)
        Version of the baseline, 0 for no baseline.
    """

    history: StiffnessHistory
    state: CodeArray
    is_settled: npt.NDArray[np.bool_]
    is_simulated: npt.NDArray[np.bool_]
    verdict: CodeArray
    level: CodeArray
    change: FloatArray
    change_std: FloatArray
    deviation: FloatArray
    deviation_std: FloatArray
    baseline_version: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.history)


@dataclass(frozen=True)
class StoredDecision:
    """Decision on one of the `QUANTITIES` of a film, from the readings of one estimator.

    `baseline_version` is the version of the baseline with which the readings were compared; None
    if there was no baseline.
    """

    quantity: str
    estimator: Estimator
    baseline_version: int | None
    decision: Decision


CONDITION_COLUMNS = (
    *("speed_rpm", "power_mw", "eccentricity_ratio", "u_eccentricity"),
    *("attitude_deg", "oil_temperature_c"),
)
MEASURED_COLUMNS = (
    *("ln_k", "u_random", "shaft_um_pk", "bearing_um_pk", "ln_ck", "u_ck"),
    *("shaft_phase_deg", "bearing_phase_deg"),
)
CHANGE_COLUMNS = ("change", "change_std", "deviation", "deviation_std")
VALUE_COLUMNS = (*MEASURED_COLUMNS, "evidence", "reason")
FINDING_COLUMNS = (
    *("verdict", "level", "change", "change_std", "time_scale_h"),
    *("deviation", "deviation_std", "cause", "cause_reason"),
)
COLUMNS = (
    *("series", "estimator", "time_ns", "provenance", "operating_state", "is_settled"),
    *CONDITION_COLUMNS,
    *(f"{name}_{d}" for d in DIRECTIONS for name in VALUE_COLUMNS),
    *(f"{name}_{q}" for q in QUANTITIES for name in FINDING_COLUMNS),
    "baseline_version",
)
INSERT = insert("film_reading", COLUMNS) + " ON CONFLICT (series, estimator, time_ns) DO NOTHING"
MEASURED_THEN = f"""
    SELECT {", ".join(CONDITION_COLUMNS)} FROM film_reading
    WHERE series = ? AND estimator = ? AND time_ns = ?
"""  # noqa: S608
SET_DECISION = upsert(
    "film_decision",
    ("series", "quantity", "estimator", "baseline_version", "document"),
    ("series", "quantity"),
)
READ_NUMBERS = (
    *("time_ns", "operating_state", "is_settled", *CONDITION_COLUMNS, "baseline_version"),
    *(f"{name}_{d}" for name in (*MEASURED_COLUMNS, "evidence") for d in DIRECTIONS),
    *(f"{name}_{q}" for name in ("verdict", "level", *CHANGE_COLUMNS) for q in QUANTITIES),
)
"""Numeric columns that are read into the arrays of `FilmHistory`."""

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
    """Insert film readings that are not stored yet, and replace the decisions on their films."""
    for each in news:
        reading = each.reading
        series = series_of(writer, reading.unit, reading.bearing)
        writer.execute(INSERT, _row(writer, series, each, provenance))
        for finding, decision in zip(each.findings, each.decisions, strict=True):
            rest = (reading.estimator, finding.baseline_version, to_json(decision))
            writer.execute(SET_DECISION, (series, finding.quantity, *rest))


def _row(
    writer: Connection, series: int, news: FilmNews, provenance: Provenance
) -> tuple[object, ...]:
    reading = news.reading
    key = (series, reading.estimator.value)
    measured = tuple(_or_null(getattr(reading, name)) for name in CONDITION_COLUMNS)
    return (
        *(*key, unique_time_ns(writer, MEASURED_THEN, key, reading.time_ns, measured)),
        provenance.value,
        *(int(reading.condition.state), int(reading.condition.is_settled)),
        *measured,
        *(cell for value in reading.values for cell in _value_cells(value)),
        *(cell for finding in news.findings for cell in _finding_cells(finding)),
        news.findings[0].baseline_version,
    )


def _value_cells(value: FilmValue) -> tuple[object, ...]:
    numbers = (_or_null(getattr(value, name)) for name in MEASURED_COLUMNS)
    return (*numbers, int(value.outcome), value.reason.value)


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
    """Return the stored decisions on the film of a bearing, in the order of `QUANTITIES`.

    Raises `StoreError` if the document of a decision is invalid.
    """
    rows = reader.execute(
        "SELECT quantity, estimator, baseline_version, document FROM film_decision"
        " JOIN series ON series.id = film_decision.series WHERE unit = ? AND bearing = ?",
        (unit, bearing),
    )
    try:
        found = {
            name: StoredDecision(name, Estimator(estimator), version, from_json(Decision, document))
            for name, estimator, version, document in rows
        }
    except ValueError as error:
        name = f"stored decision of unit {unit} bearing {bearing}"
        raise StoreError(f"{name} is invalid ({error}); restore a backup") from error
    return [found[name] for name in QUANTITIES if name in found]


def select_film_history(reader: Connection, query: FilmQuery) -> FilmHistory:
    """Return the readings of one film that match a query, oldest first."""
    rows = reader.execute(SELECT, _arguments(query)).fetchall()[::-1]
    numbers = np.array([row[:-1] for row in rows], dtype=np.float64)
    column = dict(zip(READ_NUMBERS, numbers.reshape(-1, len(READ_NUMBERS)).T, strict=True))
    time_ns = np.array([row[0] for row in rows], dtype=np.int64)  # not exact as floats
    return _history(time_ns, column, np.array([row[-1] == Provenance.SIMULATED for row in rows]))


def _arguments(query: FilmQuery) -> dict[str, Any]:
    return {
        "unit": query.unit,
        "bearing": query.bearing,
        "estimator": query.estimator.value,
        "start_ns": storable(query.start_ns),
        "end_ns": storable(query.end_ns),
        **condition_arguments(query.states, query.eccentricity_ratio, query.oil_temperature_c),
        "newest": 2**63 - 1 if query.newest is None else query.newest,
    }


def _history(
    time_ns: npt.NDArray[np.int64],
    column: dict[str, npt.NDArray[np.float64]],
    is_simulated: npt.NDArray[np.bool_],
) -> FilmHistory:
    def pair(name: str, ends: Iterable[str] = DIRECTIONS) -> npt.NDArray[np.float64]:
        return np.stack([column[f"{name}_{end}"] for end in ends])

    def codes(values: npt.NDArray[np.float64]) -> npt.NDArray[np.int8]:
        return np.nan_to_num(values).astype(np.int8)

    return FilmHistory(
        history=StiffnessHistory(
            time_ns=time_ns,
            **{name: column[name] for name in CONDITION_COLUMNS},
            **{name: pair(name) for name in MEASURED_COLUMNS},
            outcome=codes(pair("evidence")),
        ),
        state=codes(column["operating_state"]),
        is_settled=column["is_settled"] > 0.0,
        is_simulated=is_simulated.astype(np.bool_),
        verdict=codes(pair("verdict", QUANTITIES)),
        level=codes(pair("level", QUANTITIES)),
        **{name: pair(name, QUANTITIES) for name in CHANGE_COLUMNS},
        baseline_version=np.nan_to_num(column["baseline_version"]).astype(np.int64),
    )
