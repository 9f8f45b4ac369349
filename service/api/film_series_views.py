"""Readings of a film by column, in the words of the API."""

from typing import Any, cast

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.history import CodeArray, ReadingOutcome
from core.change.decision import Verdict
from core.condition.operating_state import OperatingState
from core.units import NS_PER_S
from service.api.film_conditions import STATE_NAMES
from service.api.film_series_models import EvidenceName, FilmReadingsModel, FilmSeriesModel
from service.api.film_views import level_name, verdict_name
from service.runtime.times import rfc3339
from service.store.film_port import FilmHistory, FilmQuery

Rows = npt.NDArray[np.int64]

EVIDENCE_NAMES = {code: cast("EvidenceName", code.name.lower()) for code in ReadingOutcome}


def rows_shown(n_found: int, max_points: int, is_thinned: bool) -> Rows:
    """Which readings are given: evenly thinned and the newest among them, or the newest ones."""
    if n_found <= max_points:
        return np.arange(n_found)
    if not is_thinned:
        return np.arange(n_found - max_points, n_found)
    return np.unique(np.round(np.linspace(0, n_found - 1, max_points)).astype(np.int64))


def film_readings_model(query: FilmQuery, found: FilmHistory, rows: Rows) -> FilmReadingsModel:
    """Some readings of a film.

    Parameters
    ----------
    rows
        Those to be given.
    """
    history, first = found.history, int(rows[0]) if rows.size else 0
    x, y = (_series(found, direction, rows) for direction in range(2))
    return FilmReadingsModel(
        unit=query.unit,
        bearing=query.bearing,
        estimator=query.estimator.value,
        start=rfc3339(query.start_ns),
        end=rfc3339(query.end_ns),
        n_found=len(found),
        next_end=rfc3339(int(history.time_ns[first])) if first else None,
        time=(history.time_ns[rows] / NS_PER_S).tolist(),
        provenance=["simulated" if one else "measured" for one in found.is_simulated[rows]],
        operating_state=[STATE_NAMES[OperatingState(code)] for code in found.state[rows]],
        is_settled=found.is_settled[rows].tolist(),
        speed_rpm=listed(history.speed_rpm[rows]),
        power_mw=listed(history.power_mw[rows]),
        eccentricity_ratio=listed(history.eccentricity_ratio[rows]),
        attitude_deg=listed(history.attitude_deg[rows]),
        oil_temperature_c=listed(history.oil_temperature_c[rows]),
        baseline_version=[int(v) or None for v in found.baseline_version[rows]],
        x=x,
        y=y,
    )


def _series(found: FilmHistory, direction: int, rows: Rows) -> FilmSeriesModel:
    history = found.history

    def column(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        return np.asarray(values[direction, rows])

    stiffness = np.exp(column(history.ln_k))
    return FilmSeriesModel(
        stiffness_n_per_m=listed(stiffness),
        u_random_n_per_m=listed(stiffness * column(history.u_random)),
        shaft_um_pk=listed(column(history.shaft_um_pk)),
        bearing_um_pk=listed(column(history.bearing_um_pk)),
        evidence=[EVIDENCE_NAMES[ReadingOutcome(code)] for code in column(history.outcome)],
        verdict=[verdict_name(Verdict(code)) for code in column(found.verdict)],
        level=_levels(column(found.level)),
        change_percent=listed(100.0 * np.expm1(column(found.change))),
        deviation_percent=listed(100.0 * np.expm1(column(found.deviation))),
    )


def _levels(codes: CodeArray) -> list[Any]:
    return [level_name(int(code) or None) for code in codes]


def listed(values: FloatArray) -> list[float | None]:
    """Numbers for JSON: null where there is none."""
    return [None if np.isnan(value) else value for value in values.tolist()]
