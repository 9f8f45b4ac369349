"""Route for the overview of the plant: what a tile shows of each unit, and what changed."""

from collections.abc import Hashable
from functools import partial
from typing import Annotated

from fastapi import Request, Response
from pydantic import Field

from core.quality import Level, Reading
from core.stiffness.estimators import is_reversed, reported_name
from service.api.auth.gate import GuardedRouter, subject_router
from service.api.context import Context
from service.api.parameters import parameter
from service.api.routes.bearings import ResultModel, result_model
from service.api.routes.films import FilmBriefModel, film_brief
from service.api.routes.plant import BasicUnitModel, LinkModel
from service.api.values import (
    STATE_NAMES,
    ApiModel,
    OperatingStateName,
    ReadingModel,
    reading_model,
)
from service.live.alarm_list import AlarmCount
from service.live.current_state import CHECK_S
from service.settings.bearings import BearingSettings
from service.settings.storage import Origin

SHOWN = (
    "speed_rpm",
    "power_mw",
    "stiffness_xx_n_per_m",
    "stiffness_yy_n_per_m",
    "order1_shaft_x_um_pk",
    "order1_shaft_y_um_pk",
    "eccentricity_ratio",
    "oil_temperature_c",
)
"""Quantities that the overview contains; stiffness is a ratio where the bracket is unknown."""

Revision = Annotated[str, Field(examples=["9f86d081-412"])]


class TileModel(ResultModel):
    """Newest result of a bearing as shown on a tile: main readings, with six digits, and the film.

    Only the readings of the preferred stiffness have an uncertainty.
    """

    name: Annotated[str | None, Field(examples=["upper guide"])]
    film: FilmBriefModel

    bad_reasons: Annotated[list[str], Field(examples=[["no_vortex"]])]
    """Distinct reasons of all readings of the bearing whose level is bad."""

    doubtful_signs: Annotated[list[str], Field(examples=[["ujb_shaft_x", "ujb_bearing_x"]])]
    """Channels of a direction in which stiffness or damping reads negative: the sign of one of them
    is wrong."""


class UnitTileModel(BasicUnitModel):
    """Generating unit as shown on a tile."""

    source: LinkModel
    operating_state: OperatingStateName | None
    is_settled: bool | None

    bearings: list[TileModel]
    """Newest results of the guide bearings."""


class OverviewModel(ApiModel):
    """Overview of the plant: units, alarms, and state of the service."""

    origin: Origin
    alarms: AlarmCount

    revision: Revision
    """Parameter ``since`` with which the next request obtains only the units that changed."""

    since: Revision | None
    """Revision after which the listed units changed; null if all units are listed."""

    plant: str
    """Name of the plant for display."""

    refresh_s: float
    """Time between successive results, s."""

    store_error: str | None
    """Reason why results cannot be stored or read; null without a fault."""

    captures_error: str | None
    """Reason why the newest recording around an alarm failed; null if it succeeded."""

    units: list[UnitTileModel]
    """Units of the plant that changed since the requested revision, or all units."""


class Overview:
    """Overview of the plant with a revision, and the revision of the last change of each unit."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._n = 0
        self._head: Hashable = None
        self._store_error: str | None = None
        self._seen: Hashable = None
        self._units: dict[str, tuple[Hashable, int]] = {}
        self._tiles: dict[str, tuple[int, UnitTileModel]] = {}

    def revision(self) -> int:
        """Return the revision of the overview, a number that each observed change increases."""
        live, alarms, plant = self._context.live, self._context.alarms, self._context.plant()
        seen = live.n_reports, int(self._context.clock.monotonic_s() / CHECK_S)
        if seen != self._seen:
            self._seen = seen
            for unit in self._context.units:
                now = self._context.now_revision(unit)
                if unit not in self._units or self._units[unit][0] != now:
                    self._n += 1
                    self._units[unit] = now, self._n
            self._store_error = live.store_error
        head = self._store_error, alarms.revision, plant.captures.error
        self._n += head != self._head
        self._head = head
        return self._n

    def model(self, since: str | None) -> OverviewModel:
        """Return the API model of the overview at its newest revision.

        `since` is the revision after which units have changed, as text; None for all units.
        """
        context, started = self._context, self._context.answers.started
        process, _, number = (since or "").partition("-")
        before = int(number) if process == started and number.isdecimal() else 0
        return OverviewModel.of(
            context,
            revision=f"{started}-{self._n}",
            since=since if before else None,
            plant=context.plant_name,
            store_error=context.live.store_error,
            alarms=context.alarms.count(),
            captures_error=context.plant().captures.error,
            units=[self._tile(unit, at) for unit, (_, at) in self._units.items() if at > before],
        )

    def _tile(self, unit: str, at: int) -> UnitTileModel:
        """Return the tile of a unit, built once for each of its revisions."""
        kept = self._tiles.get(unit)
        if kept is not None and kept[0] == at:
            return kept[1]
        settings = self._context.units[unit]
        live = (self._context.live.current(unit, bearing.id) for bearing in settings.bearing)
        newest = (c.assessment for c in live if c.assessment and c.is_current)
        condition = next((found.condition for found in newest if found.condition), None)
        tile = UnitTileModel.of(
            settings,
            source=self._context.live.status(unit),
            operating_state=condition and STATE_NAMES[condition.state],
            is_settled=condition and condition.is_settled,
            bearings=[self._bearing(unit, bearing) for bearing in settings.bearing],
        )
        self._tiles[unit] = at, tile
        return tile

    def _bearing(self, unit: str, settings: BearingSettings) -> TileModel:
        bearing = settings.id
        current = self._context.live.current(unit, bearing)
        shown = [reported_name(current.readings, name) for name in SHOWN]
        readings = {name: _brief(name, current.readings[name]) for name in shown}
        bad = (r.quality for r in current.readings.values() if r.quality.level is Level.BAD)
        return TileModel.of(
            result_model(current, bearing, readings),
            name=settings.name,
            bad_reasons=list(dict.fromkeys(quality.reason.value for quality in bad)),
            doubtful_signs=[
                getattr(settings, f"{place}_{axis}")
                for axis in "xy"
                if is_reversed(current.readings, axis * 2)
                for place in ("shaft", "bearing")
            ],
            film=film_brief(self._context, unit, bearing),
        )


def _brief(name: str, reading: Reading) -> ReadingModel:
    """Return a reading as a tile shows it: in six digits, and uncertain if it is a stiffness."""
    found = reading_model(reading)
    found.value = _six_digits(found.value)
    if not name.startswith("stiffness_"):
        found.uncertainty = None
    for end, value in found.uncertainty or ():
        setattr(found.uncertainty, end, _six_digits(value))
    return found


def _six_digits(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")


def overview_router(context: Context) -> GuardedRouter:
    """Return the router for the overview."""
    router = subject_router("", "plant")
    shown = Overview(context)

    @router.get("/overview", response_model=OverviewModel)
    async def overview(
        request: Request,
        since: Annotated[
            str | None,
            parameter(
                "`revision` of an earlier answer: only units that changed after it.",
                "9f86d081-412",
                max_length=40,
            ),
        ] = None,
    ) -> Response:
        """Return all units with bearings and films; values that are not current are null."""
        make = partial(shown.model, since)
        return await context.answers.of(request, shown.revision, make, is_polled=True)

    return router
