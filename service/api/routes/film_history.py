"""Route for the stiffness readings of an oil film over time, with their operating conditions."""

import asyncio
from collections.abc import Iterable, Iterator
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from fastapi import Query, Request, Response

from core.baseline.history import DIRECTIONS, ReadingOutcome, absolute_and_ratio
from core.change.decision import Verdict
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel
from core.machine.unit import Estimator
from service.api.auth.gate import GuardedRouter, subject_router
from service.api.context import BearingId, Context, UnitId
from service.api.parameters import Eccentricity, OilTemperature, States, TimeRange, at_most
from service.api.problems import problem_responses
from service.api.routes.films import VerdictName, watched_place
from service.api.tables import Column, Format, column_of, table_content, table_response
from service.api.values import (
    ApiModel,
    BearingHistory,
    ByName,
    OperatingStateName,
    Time,
    TimeNs,
    listed,
    states_named,
)
from service.settings.alarm_kinds import AlarmLevelName
from service.store.film_readings import FilmHistory, FilmQuery
from service.store.port import QueryTooLargeError


class FilmSeriesModel(ApiModel):
    """Readings of a film in x or y; every list has one value per time, null if unknown."""

    stiffness_n_per_m: list[float | None]
    stiffness_of_kb: list[float | None]

    u_random_n_per_m: list[float | None]
    """Random standard uncertainty of the stiffness, N/m."""

    u_random_of_kb: list[float | None]
    """Random standard uncertainty of this ratio."""

    shaft_um_pk: list[float | None]
    """1× amplitude of the shaft relative to the bearing, µm zero-to-peak."""

    bearing_um_pk: list[float | None]
    """1× amplitude of the bearing, µm zero-to-peak."""

    evidence: list[Annotated[Literal["measured", "insufficient_excitation", "bad_quality"], ByName]]
    """State of the reading: "measured", or the reason why its stiffness is unknown."""

    verdict: list[Annotated[VerdictName, ByName]]
    """Verdict on the film when the reading was made."""

    level: list[Annotated[AlarmLevelName, ByName] | None]
    """Alarm level in force when the reading was made; null without a level."""

    change_percent: list[float | None]
    deviation_percent: list[float | None]
    ck_s: list[float | None]

    u_random_ck_s: list[float | None]
    """Random standard uncertainty of damping over stiffness, s."""

    ck_verdict: list[Annotated[VerdictName, ByName]]
    """Verdict on damping over stiffness when the reading was made."""

    ck_level: list[Annotated[AlarmLevelName, ByName] | None]
    ck_change_percent: list[float | None]

    ck_deviation_percent: list[float | None]
    """Deviation of damping over stiffness from the baseline, %; null if it was not compared."""


class FilmReadingsModel(BearingHistory):
    """Stiffness readings of an oil film with their operating conditions, oldest first."""

    estimator: Estimator
    n_found: int
    operating_state: list[Annotated[OperatingStateName, ByName]]
    is_settled: list[bool]
    speed_rpm: list[float | None]
    power_mw: list[float | None]
    eccentricity_ratio: list[float | None]
    attitude_deg: list[float | None]
    oil_temperature_c: list[float | None]
    baseline_version: list[int | None]
    x: FilmSeriesModel
    y: FilmSeriesModel

    next_end: Time | None
    """Without thinning, parameter ``end`` for the page of older readings; null if there is none."""

    time: list[TimeNs]
    """Times of the readings."""

    provenance: list[Literal["measured", "simulated"]]
    """Origin of the readings: "measured" on the machine, or "simulated"."""


NUMBERS = ("speed_rpm", "power_mw", "eccentricity_ratio", "attitude_deg", "oil_temperature_c")
"""Names of the numbers of the operating condition, in the history and in the answer."""

Rows = npt.NDArray[np.int64]


def rows_shown(n_found: int, max_points: int, is_thinned: bool) -> Rows:
    """Return the indices of at most `max_points` of `n_found` rows, ascending, with the newest row.

    With `is_thinned`, rows are selected evenly from all rows; otherwise the newest rows are
    selected.
    """
    if n_found <= max_points:
        return np.arange(n_found)
    if not is_thinned:
        return np.arange(n_found - max_points, n_found)
    return np.unique(np.round(np.linspace(0, n_found - 1, max_points)).astype(np.int64))


def film_readings_model(query: FilmQuery, found: FilmHistory, rows: Rows) -> FilmReadingsModel:
    """Return the API model of selected readings of a film, oldest first.

    `rows` are the indices of the selected rows of the history, ascending; they may be empty.
    """
    history, first = found.history, int(rows[0]) if rows.size else 0
    x, y = (_series(found, direction, rows) for direction in range(2))
    return FilmReadingsModel.of(
        query,
        n_found=len(found),
        next_end=int(history.time_ns[first]) if first else None,
        time=history.time_ns[rows].tolist(),
        provenance=["simulated" if one else "measured" for one in found.is_simulated[rows]],
        operating_state=[OperatingState(code) for code in found.state[rows]],
        is_settled=found.is_settled[rows].tolist(),
        **{name: listed(getattr(history, name)[rows]) for name in NUMBERS},
        baseline_version=[int(v) or None for v in found.baseline_version[rows]],
        x=x,
        y=y,
    )


def _series(found: FilmHistory, direction: int, rows: Rows) -> FilmSeriesModel:
    history = found.history

    def column(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        return np.asarray(values[direction, rows])

    def decided(row: int, prefix: str = "") -> dict[str, Any]:
        verdicts, levels = found.verdict[row, rows], found.level[row, rows]
        return {
            f"{prefix}verdict": [Verdict(code) for code in verdicts],
            f"{prefix}level": [AlarmLevel(code) if code else None for code in levels],
            f"{prefix}change_percent": listed(100.0 * np.expm1(found.change[row, rows])),
            f"{prefix}deviation_percent": listed(100.0 * np.expm1(found.deviation[row, rows])),
        }

    ck_s = np.exp(column(history.ln_ck))
    ln_k = column(history.ln_k)
    k, of_kb = absolute_and_ratio(np.exp(ln_k), ln_k)
    u_k, u_of_kb = absolute_and_ratio(np.exp(ln_k) * column(history.u_random), ln_k)
    return FilmSeriesModel.of(
        stiffness_n_per_m=listed(k),
        stiffness_of_kb=listed(of_kb),
        u_random_n_per_m=listed(u_k),
        u_random_of_kb=listed(u_of_kb),
        shaft_um_pk=listed(column(history.shaft_um_pk)),
        bearing_um_pk=listed(column(history.bearing_um_pk)),
        evidence=[ReadingOutcome(code) for code in column(history.outcome)],
        **decided(direction),
        ck_s=listed(ck_s),
        u_random_ck_s=listed(ck_s * column(history.u_ck)),
        **decided(direction + len(DIRECTIONS), "ck_"),
    )


CONDITION = ("provenance", "operating_state", "is_settled", *NUMBERS, "baseline_version")
"""Names of the table columns that do not depend on the direction."""


def film_table(model: FilmReadingsModel) -> list[Column]:
    """Return the readings of a film as table columns."""
    return [
        Column("time_utc", "time", model.time),
        *_columns(model, CONDITION),
        *_columns(model.x, FilmSeriesModel.model_fields, "x_"),
        *_columns(model.y, FilmSeriesModel.model_fields, "y_"),
    ]


def _columns(model: ApiModel, names: Iterable[str], prefix: str = "") -> Iterator[Column]:
    for name in names:
        yield column_of(type(model), name, getattr(model, name), prefix)


MAX_POINTS = 20_000

MAX_READ = 120_000
"""Maximum number of readings that one request reads: two years of readings every ten minutes."""


def film_history_router(context: Context) -> GuardedRouter:
    """Return the router for the stored readings of a film."""
    router = subject_router("/units/{unit}/bearings/{bearing}/film", "film")

    @router.get(
        "/readings",
        response_model=FilmReadingsModel,
        responses=problem_responses(own={409: "The film is not watched"})
        | table_content("Readings, by column"),
    )
    async def film_readings(
        request: Request,
        unit: UnitId,
        bearing: BearingId,
        times: TimeRange,
        wanted: Format,
        eccentricity: Eccentricity,
        oil_temperature: OilTemperature,
        state: States = None,
        max_points: Annotated[int, at_most(MAX_POINTS, "readings", minimum=2)] = 2000,
        thin: Annotated[
            bool,
            Query(
                description="Whether to thin more readings than that evenly, keeping the newest;"
                " otherwise the newest readings are given, and `next_end` for the page"
                " before."
            ),
        ] = True,
    ) -> Response:
        """List the readings of a film with stiffness and operating condition, oldest first.

        As CSV or Parquet: one row per reading.
        """
        place = watched_place(context, unit, bearing)
        query = FilmQuery(
            unit=unit,
            bearing=bearing,
            estimator=place.estimator,
            start_ns=times[0],
            end_ns=times[1],
            states=states_named(state),
            eccentricity_ratio=eccentricity,
            oil_temperature_c=oil_temperature,
            newest=MAX_READ + 1,
        )

        def read() -> FilmReadingsModel:
            found = context.store.films.history(query)
            if len(found) > MAX_READ:
                detail = f"the range has more than {MAX_READ} readings; request a shorter range"
                raise QueryTooLargeError(detail)
            return film_readings_model(query, found, rows_shown(len(found), max_points, thin))

        if wanted == "json":
            revision = partial(context.past_revision, unit, times)
            return await context.answers.of(request, revision, read)
        columns = await asyncio.to_thread(lambda: film_table(read()))
        return table_response(wanted, columns, f"film-{unit}-{bearing}")

    return router
