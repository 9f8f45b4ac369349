"""Recordings of samples: listed, described, and to take away."""

from collections.abc import Callable, Generator
from typing import Annotated, Any

import structlog
from fastapi import APIRouter, Path, Query, Response
from fastapi.responses import StreamingResponse

from acquisition.errors import ConfigError
from service.api.auth.declared import needs
from service.api.context import Context
from service.api.downloads import TooManyDownloadsError
from service.api.problems import ProblemError, described_problems
from service.api.recording_models import (
    RecordingInfoModel,
    RecordingsModel,
    RunningRecordingModel,
)
from service.api.recording_views import recording_info, recording_model
from service.api.rendering import rendered, worked
from service.recordings.library import Shelf
from service.store.access.identities import Permission
from service.store.waveform_port import WaveformKind

RecordingId = Annotated[
    str,
    Path(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,119}$",
        description="Name of a recording.",
        examples=["U1-20261121T090312.400Z-shaft_x"],
    ),
]

LIST_PROBLEMS = described_problems({404: "No recordings are kept here", 422: "A wrong parameter"})

PROBLEMS = described_problems(
    {
        404: "Unknown recording",
        422: "A wrong parameter",
        410: "Damaged on the disk, and not handed out",
        503: "Too many downloads are on their way",
    }
)

Pieces = Generator[bytes, None, None]

log = structlog.get_logger()


def recording_router(context: Context) -> APIRouter:
    """Routes about recordings; they change nothing."""
    router = APIRouter(
        prefix="/api/v1/recordings", tags=["recordings"], dependencies=[needs(Permission.READ)]
    )

    @router.get("", summary="Recordings", responses=LIST_PROBLEMS)
    async def recordings(
        unit: Annotated[
            str | None, Query(description="Only of this unit.", examples=["U1"])
        ] = None,
        kind: Annotated[
            WaveformKind | None, Query(description="Only of this kind.", examples=["capture"])
        ] = None,
        limit: Annotated[int, Query(ge=1, le=500, description="Most recordings given.")] = 100,
    ) -> RecordingsModel:
        """The newest recordings, and which samples around alarms are still being written."""
        if unit is not None:
            context.unit(unit)
        found = await worked(lambda: shelf_of(context).newest(limit, unit, kind))
        running = sorted(context.captures.being_made)
        return RecordingsModel(
            recordings=[recording_model(kept) for kept in found],
            being_made=[RunningRecordingModel(alarm=a, occurrence=n) for a, n in running],
            error=context.captures.trouble,
            continuous=sorted(context.tape.units) if context.tape else [],
            continuous_error=context.tape.trouble if context.tape else None,
        )

    @router.get(
        "/{recording}",
        summary="One recording",
        responses=PROBLEMS,
        response_model=RecordingInfoModel,
    )
    async def one_recording(recording: RecordingId) -> Response:
        """Channels, holes, refused samples and files of a recording, after checking all of it."""
        shelf = shelf_of(context)
        kept = await worked(lambda: shelf.one(recording))
        if kept is None:
            raise unknown_recording(recording)
        try:
            return await rendered(lambda: recording_info(shelf, kept))
        except ConfigError as error:
            raise damaged_recording(recording, error) from error

    @router.get(
        "/{recording}/files.zip",
        summary="The files of a recording",
        response_class=StreamingResponse,
        responses={**PROBLEMS, 200: _content("application/zip", "A ZIP file")},
    )
    async def files(recording: RecordingId) -> StreamingResponse:
        """The recording as it lies on the disk: `padwatch recording` and `padwatch replay` read it.

        Its checksums are in its manifest.
        """
        make = shelf_of(context).zip_pieces
        return await _download(context, recording, make, "application/zip", "zip")

    @router.get(
        "/{recording}/samples.csv",
        summary="The samples of a recording",
        response_class=StreamingResponse,
        responses={**PROBLEMS, 200: _content("text/csv", "A CSV file")},
    )
    async def samples(recording: RecordingId) -> StreamingResponse:
        """A row for each sample in engineering units, which are in the headings.

        Like the files of `padwatch recording export`: where samples are missing there are no rows,
        and where a channel was bad, its cells say nan.
        """
        make = shelf_of(context).csv_pieces
        return await _download(context, recording, make, "text/csv", "csv")

    return router


async def _download(
    context: Context, recording: str, make: Callable[[str], Pieces], media_type: str, suffix: str
) -> StreamingResponse:
    shelf = shelf_of(context)
    if await worked(lambda: shelf.one(recording)) is None:
        raise unknown_recording(recording)
    try:
        pieces = await context.downloads.download(await worked(lambda: make(recording)))
    except TooManyDownloadsError as error:
        raise ProblemError(503, "Busy", f"{error}; try again later") from error
    except (ConfigError, OSError) as error:
        raise damaged_recording(recording, error) from error
    headers = {
        "Content-Disposition": f'attachment; filename="{recording}.{suffix}"',
        "X-Content-Type-Options": "nosniff",
    }
    return StreamingResponse(pieces, media_type=media_type, headers=headers)


def shelf_of(context: Context) -> Shelf:
    """Where finished recordings are, or answer 404."""
    if context.recordings is None:
        words = "no recordings are kept here: those of units are where these are analysed"
        raise ProblemError(404, "No recordings", words)
    return Shelf(context.recordings, context.faults())


def unknown_recording(recording: str) -> ProblemError:
    """There is none of that name."""
    return ProblemError(404, "Unknown recording", f"there is no recording {recording!r}")


def damaged_recording(recording: str, error: Exception) -> ProblemError:
    """It is damaged on the disk, which is logged."""
    log.error("a recording cannot be read", recording=recording, reason=str(error))
    words = f"recording {recording} is damaged on the disk, and nothing of it is handed out"
    return ProblemError(410, "Damaged", words)


def _content(media_type: str, words: str) -> dict[str, Any]:
    schema = {"type": "string", "format": "binary"}
    return {"description": words, "content": {media_type: {"schema": schema}}}
