"""Routes for recordings of samples: list, description, shaft motion and download."""

import asyncio
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from typing import Annotated, Literal

import structlog
from fastapi import Path, Response
from fastapi.responses import StreamingResponse
from pydantic import Field

from acquisition.delivery.units import UNIT_OF
from acquisition.errors import ConfigError
from service.api.answers import rendered
from service.api.auth.gate import GuardedRouter, subject_router
from service.api.context import Context
from service.api.downloads import attachment, file_content
from service.api.parameters import at_most, duration, only, parameter
from service.api.problems import ProblemError, problem_responses
from service.api.routes.alarm_models import AlarmIdText
from service.api.routes.channels import ChannelUnit, count_of
from service.api.routes.motion import MAX_SAMPLES, MotionModel, motion_model
from service.api.values import ApiModel, Time
from service.recordings.library import RecordingEntry, RecordingLibrary
from service.recordings.motion import recorded_motion
from service.settings.core_values import machine_of
from service.store.waveforms import WaveformKind


class RunningRecordingModel(ApiModel):
    """Recording in progress, identified by the alarm that caused it."""

    alarm: AlarmIdText
    occurrence: int


class RecordingAlarmModel(RunningRecordingModel):
    """Alarm event that caused a recording."""

    change: Annotated[str, Field(examples=["raised"])]
    time: Time

    level: str | None
    """Level of the alarm at the time of the event; null without a level."""


class RecordingModel(ApiModel):
    """Finished recording of samples."""

    start: Time | None
    rate_hz: float | None
    n_samples: int | None

    id: Annotated[str, Field(validation_alias="name", examples=["U1-20261121T090312.400Z-shaft_x"])]
    """Name of the recording."""

    kind: WaveformKind
    """"capture" for samples around an alarm, "continuous" for a part of a continuous recording."""

    state: Literal["complete", "damaged"]
    """State of the files according to the manifest and the newest check."""

    reason: Annotated[str | None, Field(validation_alias="fault")]
    """Reason why the recording is damaged; null if it is complete."""

    unit: str | None
    """Identifier of the unit. This and all nullable fields below are null without a manifest."""

    duration_s: float | None
    """Duration without gaps, s."""

    n_bytes: int
    """Size of all files of the recording, bytes."""

    alarms: list[RecordingAlarmModel]
    """Alarm events that caused the recording, first event first; empty if continuous."""


class RecordingsModel(ApiModel):
    """List of recordings, finished and in progress, and state of recording."""

    recordings: list[RecordingModel]
    """Finished recordings, newest first."""

    being_made: list[RunningRecordingModel]
    """Recordings around alarms in progress."""

    error: str | None
    """Reason why samples around alarms cannot be recorded now; null if recording is possible."""

    continuous: list[str]
    """Identifiers of the units that are recorded continuously."""

    continuous_error: str | None
    """Reason why continuous recording fails now; null if recording does not fail."""


class RecordingInfoModel(ApiModel):
    """Description of a recording, made from a full check of its files."""

    recording: RecordingModel
    rejected: dict[str, int]

    made_by: str
    """Program that made the recording, and its purpose."""

    end: Annotated[Time, Field(validation_alias="stop_ns")]
    """End of the recording: time of the last sample plus one sampling interval."""

    n_gaps: int
    """Number of gaps in the samples."""

    n_gap_samples: int
    """Number of missing samples per channel."""

    epochs: list[int]
    """Epochs of the sample index; several if the device restarted its count meanwhile."""

    channels: dict[str, ChannelUnit]
    """Engineering unit of each waveform channel, by identifier of the channel."""

    slow_channels: dict[str, str]
    """Unit of the readings of each slow channel, by identifier of the channel."""

    n_not_ok: dict[str, int]
    """Number of samples in blocks that the device flagged as not OK, by identifier of the channel;
    without channels that were always OK."""


def recording_model(kept: RecordingEntry) -> RecordingModel:
    """Return the API model of a recording for the list of recordings."""
    manifest = kept.manifest
    described = ("unit", "start", "rate_hz", "n_samples")
    return RecordingModel.of(
        kept,
        state="complete" if kept.fault is None else "damaged",
        duration_s=manifest and manifest.n_samples / manifest.rate_hz,
        **{name: manifest and getattr(manifest, name) for name in described},
    )


def recording_info(shelf: RecordingLibrary, kept: RecordingEntry) -> RecordingInfoModel:
    """Check the files of a recording; return the API model of its description.

    Raises `ConfigError` if the recording is damaged.
    """
    manifest = kept.manifest
    if manifest is None or kept.fault is not None:
        raise ConfigError(kept.fault or "the manifest cannot be read")
    summary = shelf.summary(kept.name)
    return RecordingInfoModel.of(
        summary,
        manifest,
        recording=recording_model(kept),
        channels={each.id: UNIT_OF[each.measurand] for each in manifest.channels},
        slow_channels={each.id: each.unit for each in manifest.slow_channels},
    )


RecordingId = Annotated[
    str,
    Path(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,119}$",
        description="Name of a recording.",
        examples=["U1-20261121T090312.400Z-shaft_x"],
    ),
]

LIST_PROBLEMS = problem_responses(own={404: "This process has no recordings"})

PROBLEMS = problem_responses(
    410, own={404: "Unknown recording", 503: "Too many concurrent downloads"}
)

MOTION_PROBLEMS = problem_responses(
    410,
    own={
        404: "Unknown recording or bearing",
        409: "The recording has no samples of the bearing, or none at that time",
    },
)

MAX_SECONDS = 600.0

Pieces = Generator[bytes, None, None]

log = structlog.get_logger()


def recording_router(context: Context) -> GuardedRouter:
    """Return the router for recordings."""
    router = subject_router("/recordings", "recordings")

    @router.get("", responses=LIST_PROBLEMS)
    async def recordings(
        unit: Annotated[str | None, only("unit", "U1")] = None,
        kind: Annotated[WaveformKind | None, only("kind", "capture")] = None,
        limit: Annotated[int, at_most(500, "recordings")] = 100,
    ) -> RecordingsModel:
        """List the newest finished recordings, and the recordings around alarms in progress."""
        if unit is not None:
            context.unit(unit)
        found = await asyncio.to_thread(library_of(context).newest, limit, unit, kind)
        plant = context.plant()
        running = sorted(plant.captures.being_made)
        return RecordingsModel(
            recordings=[recording_model(kept) for kept in found],
            being_made=[RunningRecordingModel(alarm=a, occurrence=n) for a, n in running],
            error=plant.captures.trouble,
            continuous=sorted(plant.continuous),
            continuous_error=plant.continuous_trouble,
        )

    @router.get("/{recording}", responses=PROBLEMS, response_model=RecordingInfoModel)
    async def one_recording(recording: RecordingId) -> Response:
        """Check the files of a recording; return its channels, gaps, rejected samples and files."""
        kept = await entry_of(context, recording)
        with readable(recording):
            return await rendered(lambda: recording_info(library_of(context), kept))

    @router.get("/{recording}/motion", responses=MOTION_PROBLEMS, response_model=MotionModel)
    async def motion(
        recording: RecordingId,
        bearing: Annotated[str, parameter("Identifier of the bearing.", "UJB", max_length=32)],
        start_s: Annotated[
            float,
            parameter(
                "Start, seconds from the first sample of the recording.",
                30.0,
                ge=0.0,
                le=1e7,
                allow_inf_nan=False,
            ),
        ] = 0.0,
        seconds: Annotated[float, duration(MAX_SECONDS, "Duration.")] = 10.0,
    ) -> Response:
        """Return the motion of a shaft in its bearing from a part of a recording.

        The calibration stored in the recording applies. If the device restarted within this part,
        samples after the restart are omitted.
        """
        kept = await entry_of(context, recording)
        with readable(recording):
            if kept.manifest is None:
                raise ConfigError(kept.fault or "no manifest")
            unit = kept.manifest.unit
            if unit not in context.units:
                detail = f"recording {kept.name} is of unit {unit!r}, which is not in this plant"
                raise ProblemError(409, "No samples", detail)
            context.bearing(unit, bearing)
            watched = context.references.bearing(unit, bearing)
            count_of(seconds, kept.manifest.rate_hz, MAX_SAMPLES)

            def model() -> MotionModel:
                opened, machine = (
                    library_of(context).opened(recording),
                    machine_of(context.units[unit]),
                )
                found = recorded_motion(opened, machine, watched, start_s, seconds)
                position = {"offset_s": found.offset_s, "total_s": found.total_s, "received": None}
                return motion_model(unit, watched, found.motion, recording=recording, **position)

            return await rendered(model)

    @router.get(
        "/{recording}/files.zip",
        response_class=StreamingResponse,
        responses=PROBLEMS | file_content("application/zip", "A ZIP file"),
    )
    async def recording_files(recording: RecordingId) -> StreamingResponse:
        """Return the files of a recording as a ZIP file.

        `padwatch recording` and `padwatch replay` read these files. The manifest contains their
        checksums.
        """
        make = library_of(context).zip_pieces
        return await _download(context, recording, make, "application/zip", "zip")

    @router.get(
        "/{recording}/samples.csv",
        response_class=StreamingResponse,
        responses=PROBLEMS | file_content("text/csv", "A CSV file"),
    )
    async def recording_samples(recording: RecordingId) -> StreamingResponse:
        """Return the samples as CSV, one row per sample, in the engineering units of the headings.

        `padwatch recording export` writes the same format: missing samples have no rows, and cells
        of a bad channel are nan.
        """
        make = library_of(context).csv_pieces
        return await _download(context, recording, make, "text/csv", "csv")

    return router


async def _download(
    context: Context, recording: str, make: Callable[[str], Pieces], media_type: str, suffix: str
) -> StreamingResponse:
    await entry_of(context, recording)
    with readable(recording):
        pieces = await context.downloads.download(await asyncio.to_thread(make, recording))
    return attachment(pieces, media_type, f"{recording}.{suffix}")


def library_of(context: Context) -> RecordingLibrary:
    """Return the library of recordings; raise a problem of status 404 if this process has none."""
    if context.recordings is None:
        words = "this process has no recordings; ask the process that analyses the unit"
        raise ProblemError(404, "No recordings", words)
    return RecordingLibrary(context.recordings, context.plant().faults)


async def entry_of(context: Context, recording: str) -> RecordingEntry:
    """Return the library entry of a recording; raise a problem of status 404 if it is unknown."""
    found = await asyncio.to_thread(library_of(context).one, recording)
    if found is None:
        detail = f"unknown recording {recording!r}; see /api/v1/recordings"
        raise ProblemError(404, "Unknown recording", detail)
    return found


@contextmanager
def readable(recording: str) -> Iterator[None]:
    """Log an error of reading a damaged recording; raise a problem of status 410 in its place."""
    try:
        yield
    except (ConfigError, OSError) as error:
        log.error("a recording cannot be read", recording=recording, reason=str(error))
        words = f"recording {recording} is damaged on the disk and cannot be read"
        raise ProblemError(410, "Damaged", words) from error
