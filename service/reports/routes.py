"""HTTP routes of the evidence of alarms."""

import asyncio
import re
from collections.abc import AsyncIterator, Callable
from typing import Annotated, Literal
from urllib.parse import quote

import structlog
from fastapi import Path, Query, Request, Response
from fastapi.responses import HTMLResponse, StreamingResponse
from pydantic import Field

from acquisition.clock import Clock
from service.api.auth.gate import GuardedRouter, identity_of, needs
from service.api.context import Context
from service.api.downloads import Downloads, attachment, file_content
from service.api.problems import ProblemError, problem_responses
from service.api.routes.alarms import AlarmId
from service.api.values import ApiModel, ByName, Time
from service.live.snapshot import EvidenceStatus
from service.reports.archive import (
    DamagedEvidenceError,
    EvidenceArchive,
    EvidenceState,
    Occurrence,
    Occurrences,
    SamplesState,
    bundle_files,
)
from service.reports.case import read_case
from service.reports.document import Evidence
from service.reports.page import POLICY, report_page
from service.reports.tables import TableError
from service.runtime.files import zipped
from service.settings.alarm_kinds import ALARM_KINDS
from service.store.access.identities import Permission


class OccurrenceModel(ApiModel):
    """Occurrence of an alarm with the state of its evidence."""

    occurrence: int
    """Number of the occurrence, which counts how often the alarm was raised or escalated."""

    change: Annotated[str, Field(examples=["raised"])]
    """Change of the alarm: raised or escalated."""

    level: Annotated[Literal["alert", "danger"], ByName] | None
    """Alarm level after the event; null without a level."""

    time: Time
    """Time of the event."""

    state: Literal["complete", "waiting", "lost", "removed", "not_kept"]
    """State of the evidence: complete, waiting to be written, lost (by a crash, or as the disk
    could not be written for long), removed to free space, or never kept."""

    samples: Literal["complete", "being_made", "lost", "removed", "none"]
    """State of the samples around the alarm: complete, being recorded, lost, removed to free space,
    or not recorded for this alarm."""

    evidence: Annotated[
        str | None, Field(examples=["/api/v1/alarms/U1:UJB:film_stiffness/evidence/3"])
    ]
    """URL path of the evidence document; null unless complete. Append /report or /bundle.zip for
    report and bundle."""


class OccurrencesModel(ApiModel):
    """List of the occurrences of an alarm."""

    alarm: Annotated[str, Field(examples=["U1:UJB:film_stiffness"])]
    """Identifier of the alarm."""

    origin: Literal["live", "replay"]
    """Origin of the data: a live machine, or a replayed recording."""

    occurrences: list[OccurrenceModel]
    """Occurrences of the alarm, newest first."""


class EvidenceService:
    """Service of the evidence routes: lists evidence, and creates reports and bundles.

    `status` returns the state of the collector, or None if no evidence is collected; a report shows
    readings up to `trend_days` after the alarm. All methods raise StoreError if the store cannot be
    read.
    """

    def __init__(
        self,
        archive: EvidenceArchive,
        status: Callable[[], EvidenceStatus | None],
        trend_days: float,
        clock: Clock,
        downloads: Downloads,
    ) -> None:
        self.archive, self._status, self._clock = archive, status, clock
        self._downloads, self._trend_days = downloads, trend_days

    async def occurrences(self, alarm: str, most: int) -> list[tuple[Occurrence, SamplesState]]:
        """Return the newest occurrences of an alarm, newest first, each with its samples' state.

        At most `most` occurrences are returned.
        """
        pending, capturing = self._unfinished()

        def look() -> list[tuple[Occurrence, SamplesState]]:
            found = self.archive.occurrences(alarm, pending, most)
            return [(each, self.archive.samples(each, capturing)) for each in found]

        return await self._downloads.worked(look)

    async def occurrence(self, alarm: str, number: int) -> Occurrence | None:
        """Return an occurrence of an alarm; None if it does not exist."""
        pending, _ = self._unfinished()
        return await self._downloads.worked(lambda: self.archive.occurrence(alarm, number, pending))

    async def report(self, found: Occurrence) -> str:
        """Return the report of an occurrence as HTML.

        Raises
        ------
        DamagedEvidenceError, TableError, LookupError
            If the bundle cannot be read, or does not exist.
        """
        _, capturing = self._unfinished()

        def made() -> str:
            samples = self.archive.samples(found, capturing)
            case = read_case(self.archive, found, samples, self._trend_days)
            return report_page(case, self._clock.now_ns())

        return await self._downloads.worked(made)

    async def bundle(self, found: Occurrence, has_configuration: bool) -> AsyncIterator[bytes]:
        """Return the bundle of an occurrence as the chunks of a ZIP file.

        Parameters
        ----------
        has_configuration
            Whether to include the configuration of the whole plant.

        Raises
        ------
        DamagedEvidenceError, TableError, LookupError, OSError
            If the bundle cannot be read, or does not exist.
        ProblemError
            If too many downloads are in progress.
        """
        self._downloads.require_room()
        page = await self.report(found)
        files = await self._downloads.worked(
            lambda: bundle_files(self.archive, found, page, has_configuration)
        )
        return await self._downloads.download(zipped(files))

    def _unfinished(self) -> tuple[Occurrences, Occurrences]:
        """Return which bundles are to be written, and which recordings are to be linked."""
        status = self._status()
        return (frozenset(), frozenset()) if status is None else (status.pending, status.capturing)


BACK = '<nav><a href="/#/alarms">Alarm list</a></nav>'


ID = re.compile(r"([A-Za-z0-9][A-Za-z0-9_.-]{0,31}):([A-Za-z0-9][A-Za-z0-9_.-]{0,31}):([a-z0-9_]+)")

Number = Annotated[int, Path(ge=1, le=10**12, description="Occurrence number.", examples=[3])]

LIST_PROBLEMS = problem_responses(own={404: "Unknown alarm"})
PROBLEMS = problem_responses(
    own={
        404: "Unknown alarm or occurrence, or no evidence of it: the detail gives the reason",
        503: "The store cannot be read, or too many concurrent downloads",
    },
)

WHY_NOT = {
    EvidenceState.LOST: "was lost: the service ended or the disk failed before it was written",
    EvidenceState.REMOVED: "was removed to free space for newer evidence",
    EvidenceState.NOT_KEPT: "was never kept",
}

SAFE = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}

log = structlog.get_logger()


def evidence_router(context: Context, desk: EvidenceService | None) -> GuardedRouter:
    """Return the read-only routes of evidence; they respond with 404 if `desk` is None."""
    router = GuardedRouter(
        prefix="/api/v1/alarms/{alarm}/evidence",
        tags=["alarms"],
        dependencies=[needs(Permission.READ)],
    )

    @router.get("", responses=LIST_PROBLEMS)
    async def evidence_of_alarm(
        alarm: AlarmId,
        limit: Annotated[
            int, Query(ge=1, le=1000, description="Maximum number of occurrences in the answer.")
        ] = 100,
    ) -> OccurrencesModel:
        """Return the newest occurrences of an alarm, and the state of their evidence."""
        found = await _there(desk).occurrences(_known(context, alarm), limit)
        return OccurrencesModel(
            alarm=alarm,
            origin=context.origin.value,
            occurrences=[_occurrence_model(*each) for each in found],
        )

    @router.get("/{occurrence}", responses=PROBLEMS)
    async def evidence_document(alarm: AlarmId, occurrence: Number) -> Evidence:
        """Return the evidence document: the state of the unit when the alarm was raised."""
        held = _there(desk)
        found = await _complete(context, held, alarm, occurrence)
        try:
            return await asyncio.to_thread(held.archive.document, found.bundle)
        except DamagedEvidenceError as error:
            raise _damaged(error) from error

    @router.get("/{occurrence}/report", response_class=HTMLResponse, responses=PROBLEMS)
    async def evidence_report(alarm: AlarmId, occurrence: Number) -> Response:
        """Return the report as an HTML page without scripts, to read or to print on one A4 page."""
        held = _there(desk)
        found = await _complete(context, held, alarm, occurrence)
        try:
            page = await held.report(found)
        except (DamagedEvidenceError, TableError, OSError) as error:
            raise _damaged(error) from error
        page = page.replace("<body>", f"<body>{BACK}", 1)  # the copy in a bundle has no link
        return HTMLResponse(page, headers={"Content-Security-Policy": POLICY, **SAFE})

    @router.get(
        "/{occurrence}/bundle.zip",
        response_class=StreamingResponse,
        responses=PROBLEMS | file_content("application/zip", "A ZIP file"),
    )
    async def evidence_bundle(
        request: Request, alarm: AlarmId, occurrence: Number
    ) -> StreamingResponse:
        """Return a ZIP file with document, tables, report, and the samples once they are complete.

        The file includes the configuration of the plant, unless the API key is limited to units.
        """
        held = _there(desk)
        found = await _complete(context, held, alarm, occurrence)
        try:
            pieces = await held.bundle(found, has_configuration=not identity_of(request).units)
        except (DamagedEvidenceError, TableError, OSError) as error:
            raise _damaged(error) from error
        name = quote(f"padwatch-{alarm.replace(':', '-')}-{occurrence}.zip")
        return attachment(pieces, "application/zip", name, **SAFE)

    return router


def _there(desk: EvidenceService | None) -> EvidenceService:
    if desk is None:
        raise ProblemError(404, "No evidence", "this service does not collect evidence of alarms")
    return desk


def _known(context: Context, alarm: str) -> str:
    """Return a valid alarm id, also of an older plant file; raise an error for other ids."""
    match = ID.fullmatch(alarm)
    if match is None or match[3] not in ALARM_KINDS:
        context.alarms.alarm(alarm)
    return alarm


async def _complete(
    context: Context, desk: EvidenceService, alarm: str, occurrence: int
) -> Occurrence:
    found = await desk.occurrence(_known(context, alarm), occurrence)
    if found is None:
        detail = f"alarm {alarm} has no occurrence {occurrence}"
        raise ProblemError(404, "Unknown occurrence", detail)
    name = f"evidence of alarm {alarm}, occurrence {occurrence},"
    if found.state is EvidenceState.WAITING:
        raise ProblemError(409, "Not complete yet", f"{name} is being written; try again later")
    if found.state is not EvidenceState.COMPLETE:
        raise ProblemError(404, "No evidence", f"{name} {WHY_NOT[found.state]}")
    return found


def _occurrence_model(occurrence: Occurrence, samples: SamplesState) -> OccurrenceModel:
    event = occurrence.event
    path = f"/api/v1/alarms/{quote(event.identity.id, safe=':')}/evidence/{event.occurrence}"
    return OccurrenceModel.of(
        event,
        state=occurrence.state,
        samples=samples,
        evidence=path if occurrence.state is EvidenceState.COMPLETE else None,
    )


def _damaged(error: Exception) -> ProblemError:
    log.error("evidence cannot be read", reason=str(error))
    return ProblemError(500, "Damaged", f"the evidence on the disk cannot be read: {error}")
