"""The film of a bearing: what is said of it now, and its readings with their conditions."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response

from service.api.auth.declared import needs
from service.api.bearing_routes import TimeRange, eccentricity_range, oil_temperature_range
from service.api.context import BearingId, Context, UnitId
from service.api.film_conditions import states_named
from service.api.film_models import FilmModel, OperatingStateName
from service.api.film_series_models import FilmReadingsModel
from service.api.film_series_views import film_readings_model, rows_shown
from service.api.film_tables import film_table
from service.api.film_views import film_model, why_unwatched
from service.api.problems import ProblemError, described_problems, problem_responses
from service.api.rendering import rendered, worked
from service.api.tables import Column, Format, table_content, table_response
from service.live.commands import FilmPlace
from service.store.access.identities import Permission
from service.store.film_port import FilmHistory, FilmQuery
from service.store.port import QueryTooLargeError
from service.store.value_range import ValueRange

MAX_POINTS = 20_000

MAX_READ = 120_000
"""Most readings that one question may touch: two years and more of one every ten minutes."""

States = Annotated[
    list[OperatingStateName] | None,
    Query(description="Only in this operating state; may be repeated.", examples=[["full_load"]]),
]

READING_PROBLEMS = described_problems(
    {
        404: "Unknown unit or bearing",
        409: "The film is not watched",
        422: "A wrong parameter",
        503: "The store cannot be read",
    }
)


def film_router(context: Context) -> APIRouter:
    """Routes about films."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings/{bearing}/film",
        tags=["film"],
        dependencies=[needs(Permission.READ)],
    )

    @router.get(
        "", summary="A film now", response_model=FilmModel, responses=problem_responses(404)
    )
    async def film(unit: UnitId, bearing: BearingId) -> Response:
        """Verdict, change with its uncertainty, cause and condition, by direction.

        A film that cannot be judged is never called normal: the verdict says why not.
        """
        context.bearing(unit, bearing)
        return await rendered(lambda: film_model(context, unit, bearing))

    @router.get(
        "/readings",
        summary="Readings of a film",
        response_model=FilmReadingsModel,
        responses={**READING_PROBLEMS, **table_content("Readings, by column")},
    )
    async def readings(
        unit: UnitId,
        bearing: BearingId,
        times: TimeRange,
        wanted: Format,
        eccentricity: Annotated[ValueRange, Depends(eccentricity_range)],
        oil_temperature: Annotated[ValueRange, Depends(oil_temperature_range)],
        state: States = None,
        max_points: Annotated[
            int, Query(ge=2, le=MAX_POINTS, description="Most readings in the answer.")
        ] = 2000,
        thin: Annotated[
            bool,
            Query(
                description="Whether more readings than that are thinned evenly over the range,"
                " the newest among them; otherwise the newest ones are given, and `next_end` for"
                " the page before."
            ),
        ] = True,
    ) -> Response:
        """Stiffness with the conditions that it was read under, by column, oldest first.

        As CSV or Parquet, too: a row for each reading.
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

        def read() -> tuple[FilmReadingsModel, FilmHistory, list[int]]:
            found = _history(context, query)
            rows = rows_shown(len(found), max_points, thin)
            return film_readings_model(query, found, rows), found, rows.tolist()

        def read_columns() -> list[Column]:
            return film_table(*read())

        if wanted == "json":
            return await rendered(lambda: read()[0])
        return table_response(wanted, await worked(read_columns), f"film-{unit}-{bearing}")

    return router


def watched_place(context: Context, unit: str, bearing: str) -> FilmPlace:
    """Look a watched bearing up, or answer 404 or 409."""
    context.bearing(unit, bearing)
    place = context.films.place(unit, bearing)
    if place is None:
        detail = f"the film of unit {unit} bearing {bearing} is not watched: "
        raise ProblemError(409, "Not watched", f"{detail}{why_unwatched(context, unit, bearing)}")
    return place


def _history(context: Context, query: FilmQuery) -> FilmHistory:
    found = context.store.films.history(query)
    if len(found) > MAX_READ:
        raise QueryTooLargeError(f"more than {MAX_READ} readings in this range: ask for less")
    return found
