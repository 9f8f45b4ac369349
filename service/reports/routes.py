"""Evidence of alarms: what was known when one was raised, as a document, a page and a bundle."""

import asyncio
import re
from typing import Annotated, Any
from urllib.parse import quote

import structlog
from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.responses import HTMLResponse, StreamingResponse

from service.api.auth.declared import needs
from service.api.auth.gate import identity_of
from service.api.context import Context
from service.api.downloads import TooManyDownloadsError
from service.api.problems import ProblemError, described_problems
from service.api.routes.alarm_models import LEVEL_NAMES
from service.api.routes.alarms import AlarmId
from service.reports.archive import DamagedEvidenceError, EvidenceState, Occurrence
from service.reports.desk import EvidenceDesk, Found
from service.reports.document import Evidence
from service.reports.models import OccurrenceModel, OccurrencesModel
from service.reports.report.page import POLICY
from service.reports.tables import TableError
from service.runtime.times import rfc3339
from service.settings.alarm_kinds import ALARM_KINDS
from service.store.access.roles import Permission

ID = re.compile(r"([A-Za-z0-9][A-Za-z0-9_.-]{0,31}):([A-Za-z0-9][A-Za-z0-9_.-]{0,31}):([a-z0-9_]+)")

Number = Annotated[
    int, Path(ge=1, le=10**12, description="Which occurrence of the alarm.", examples=[3])
]

LIST_PROBLEMS = described_problems(
    {404: "Unknown alarm", 422: "A wrong parameter", 503: "The store cannot be read"}
)

PROBLEMS = described_problems(
    {
        404: "Unknown alarm or occurrence, or there is no evidence of it: the detail says why",
        409: "Not on the disk yet",
        422: "A wrong parameter",
        500: "Damaged on the disk",
        503: "The store cannot be read, or too many bundles are on their way",
    }
)

WHY_NOT = {
    EvidenceState.LOST: "was lost: the service ended, or the disk refused, before it was written",
    EvidenceState.REMOVED: "was removed to make room for newer evidence",
    EvidenceState.NOT_KEPT: "was never kept",
}

SAFE = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}

log = structlog.get_logger()


def evidence_router(context: Context, desk: EvidenceDesk | None) -> APIRouter:
    """Routes that show evidence, if any is kept; they change nothing."""
    router = APIRouter(
        prefix="/api/v1/alarms/{alarm}/evidence",
        tags=["alarms"],
        dependencies=[needs(Permission.READ)],
    )

    @router.get("", summary="Evidence of an alarm", responses=LIST_PROBLEMS)
    async def occurrences(
        alarm: AlarmId,
        limit: Annotated[
            int, Query(ge=1, le=1000, description="Most occurrences in the answer.")
        ] = 100,
    ) -> OccurrencesModel:
        """The newest occurrences of an alarm, and what evidence there is of each."""
        found = await _there(desk).occurrences(_known(context, alarm), limit)
        return OccurrencesModel(
            alarm=alarm,
            origin=context.origin.value,
            occurrences=[_occurrence_model(each) for each in found],
        )

    @router.get("/{occurrence}", summary="All that was known", responses=PROBLEMS)
    async def document(alarm: AlarmId, occurrence: Number) -> Evidence:
        """Everything that was known when the alarm was raised, as it was written down then."""
        held = _there(desk)
        found = await _complete(context, held, alarm, occurrence)
        place = found.place
        if place is None:  # complete ones have a place
            raise ProblemError(404, "No evidence", "there is no bundle")
        try:
            return await asyncio.to_thread(held.archive.document, place)
        except DamagedEvidenceError as error:
            raise _damaged(error) from error

    @router.get(
        "/{occurrence}/report",
        summary="Report on one page",
        response_class=HTMLResponse,
        responses=PROBLEMS,
    )
    async def report(alarm: AlarmId, occurrence: Number) -> Response:
        """HTML made for one sheet of A4, without any script, to read or to print."""
        held = _there(desk)
        found = await _complete(context, held, alarm, occurrence)
        try:
            page = await held.report(found)
        except (DamagedEvidenceError, TableError, OSError) as error:
            raise _damaged(error) from error
        return HTMLResponse(page, headers={"Content-Security-Policy": POLICY, **SAFE})

    @router.get(
        "/{occurrence}/bundle.zip",
        summary="Everything to take away",
        response_class=StreamingResponse,
        responses={**PROBLEMS, 200: _zip_content()},
    )
    async def bundle(request: Request, alarm: AlarmId, occurrence: Number) -> StreamingResponse:
        """Document, tables, report, and the samples once they are complete.

        The plant's configuration is in it, too, but not for a key of some units.
        """
        held = _there(desk)
        found = await _complete(context, held, alarm, occurrence)
        try:
            pieces = await held.bundle(found, has_configuration=not identity_of(request).units)
        except TooManyDownloadsError as error:
            raise ProblemError(503, "Busy", f"{error}; try again later") from error
        except (DamagedEvidenceError, TableError, OSError) as error:
            raise _damaged(error) from error
        name = quote(f"padwatch-{alarm.replace(':', '-')}-{occurrence}.zip")
        headers = {"Content-Disposition": f'attachment; filename="{name}"', **SAFE}
        return StreamingResponse(pieces, media_type="application/zip", headers=headers)

    return router


def _there(desk: EvidenceDesk | None) -> EvidenceDesk:
    if desk is None:
        raise ProblemError(404, "No evidence", "no evidence is kept here")
    return desk


def _known(context: Context, alarm: str) -> str:
    """Refuse what cannot be an alarm; alarms of an older plant file still have their evidence."""
    match = ID.fullmatch(alarm)
    if match is None or match[3] not in ALARM_KINDS:
        try:
            context.alarms.alarm(alarm)
        except LookupError as error:
            raise ProblemError(404, "Unknown alarm", f"there is no alarm {alarm!r}") from error
    return alarm


async def _complete(
    context: Context, desk: EvidenceDesk, alarm: str, occurrence: int
) -> Occurrence:
    """An occurrence whose evidence is there; otherwise say why it is not."""
    found = await desk.occurrence(_known(context, alarm), occurrence)
    if found is None:
        detail = f"alarm {alarm} has no occurrence {occurrence}"
        raise ProblemError(404, "Unknown occurrence", detail)
    name = f"evidence of alarm {alarm}, occurrence {occurrence},"
    if found.state is EvidenceState.WAITING:
        raise ProblemError(409, "Not on the disk yet", f"{name} is being written")
    if found.state is not EvidenceState.COMPLETE:
        raise ProblemError(404, "No evidence", f"{name} {WHY_NOT[found.state]}")
    return found


def _occurrence_model(found: Found) -> OccurrenceModel:
    occurrence, event = found.occurrence, found.occurrence.event
    path = f"/api/v1/alarms/{quote(event.identity.id, safe=':')}/evidence/{event.occurrence}"
    return OccurrenceModel(
        occurrence=event.occurrence,
        change=event.change.value,
        level=None if event.level is None else LEVEL_NAMES[event.level],
        time=rfc3339(event.time_ns),
        state=occurrence.state.value,
        samples=found.samples.value,
        evidence=path if occurrence.state is EvidenceState.COMPLETE else None,
    )


def _damaged(error: Exception) -> ProblemError:
    log.error("evidence cannot be read", reason=str(error))
    return ProblemError(500, "Damaged", f"the evidence on the disk cannot be read: {error}")


def _zip_content() -> dict[str, Any]:
    schema = {"type": "string", "format": "binary"}
    return {"description": "A ZIP file", "content": {"application/zip": {"schema": schema}}}
