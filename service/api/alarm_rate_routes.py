"""How often alarms come."""

import asyncio
from typing import Annotated

from fastapi import APIRouter, Query

from core.alarms.alarm import PLANT
from core.alarms.statistics import DAY_NS
from service.api.alarm_rate_models import AlarmRatesModel
from service.api.alarm_rate_views import alarm_rates_model, counted
from service.api.auth.declared import Reach, needs
from service.api.bearing_routes import Moment
from service.api.context import Context
from service.api.parameters import ns_from_datetime, require_order
from service.api.problems import ProblemError, described_problems
from service.store.access.identities import Permission
from service.store.port import AlarmQuery

DEFAULT_DAYS, MAX_DAYS = 7, 400

RATE_PROBLEMS = described_problems(
    {404: "Unknown unit", 422: "A wrong parameter", 503: "The store cannot be read"}
)


def alarm_rate_router(context: Context) -> APIRouter:
    """The route of alarm rates."""
    router = APIRouter(
        prefix="/api/v1/alarms", tags=["alarms"], dependencies=[needs(Permission.READ, Reach.ASKED)]
    )

    @router.get("/rates", summary="How often alarms come", responses=RATE_PROBLEMS)
    async def rates(
        unit: Annotated[
            str | None,
            Query(max_length=32, description="Of this unit only.", examples=["U1"]),
        ] = None,
        start: Annotated[
            Moment | None,
            Query(
                description="From when; seven days before the end unless given.",
                examples=["2026-11-14T09:00:00Z"],
            ),
        ] = None,
        end: Annotated[
            Moment | None,
            Query(description="Until when; now unless given.", examples=["2026-11-21T09:00:00Z"]),
        ] = None,
    ) -> AlarmRatesModel:
        """Alarms per ten minutes and per day, the most frequent, chattering and stale ones.

        Counted from stored events, of each unit and of the whole plant; at most 400 days at once.
        """
        now_ns = context.clock.now_ns()
        end_ns = ns_from_datetime(end, "end") if end else now_ns
        default_ns = max(end_ns - DEFAULT_DAYS * DAY_NS, 0)
        start_ns = ns_from_datetime(start, "start") if start else default_ns
        _check_span(start_ns, end_ns)
        if unit not in (None, PLANT):
            context.unit(unit)
        units = list(context.units) if unit is None else [unit]
        wanted = AlarmQuery(unit=unit, start_ns=start_ns, end_ns=end_ns)
        rule = context.alarms.chatter_rule
        found = await asyncio.to_thread(counted, context.store, wanted, units, rule)
        shown = {*units, PLANT} if unit is None else {unit}
        return alarm_rates_model(context.alarms, context.films, found, shown, now_ns)

    return router


def _check_span(start_ns: int, end_ns: int) -> None:
    require_order(start_ns, end_ns)
    if end_ns - start_ns > MAX_DAYS * DAY_NS:
        days = (end_ns - start_ns) / DAY_NS
        detail = f"{days:g} days are asked for, {MAX_DAYS} are counted at once"
        raise ProblemError(422, "Wrong parameter", detail, "start")
