"""The motion of a shaft in its bearing, sample by sample: now, and out of recordings."""

from collections.abc import Sequence
from typing import Annotated

from fastapi import APIRouter, Query, Response

from acquisition.errors import ConfigError
from core.machine.unit import Bearing
from core.samples.blocks import SampleBlock
from service.api.auth.declared import needs
from service.api.context import BearingId, Context, UnitId
from service.api.motion_models import MotionModel
from service.api.motion_views import MotionOrigin, motion_model
from service.api.problems import ProblemError, described_problems
from service.api.recording_routes import (
    RecordingId,
    damaged_recording,
    shelf_of,
    unknown_recording,
)
from service.api.rendering import rendered, worked
from service.live.live_view import HELD_S
from service.live.samples import newest_of, stretch_of
from service.recordings.library import Kept
from service.recordings.motion import NoMotionError, channels_for, motion_of, recorded_motion
from service.settings.core_values import machine_of
from service.settings.sources.devices import ModbusVectorSettings
from service.settings.units import UnitSettings
from service.store.access.identities import Permission

MAX_SAMPLES = 60_000
"""Of each direction in one answer: a hundred seconds at 600 Hz, and 2 MB."""

MAX_SECONDS = 600.0

LIVE_PROBLEMS = described_problems(
    {404: "Unknown unit or bearing", 409: "There are no samples", 422: "A wrong parameter"}
)
RECORDING_PROBLEMS = described_problems(
    {
        404: "Unknown recording or bearing",
        409: "It has no samples of that bearing, or none at that time",
        422: "A wrong parameter",
        410: "Damaged on the disk, and not handed out",
    }
)


def motion_router(context: Context) -> APIRouter:
    """The route of the newest motion."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings",
        tags=["bearing"],
        dependencies=[needs(Permission.READ)],
    )

    @router.get(
        "/{bearing}/motion",
        summary="Motion of the shaft",
        responses=LIVE_PROBLEMS,
        response_model=MotionModel,
    )
    async def motion(
        unit: UnitId,
        bearing: BearingId,
        seconds: Annotated[
            float,
            Query(
                gt=0.0,
                le=HELD_S,
                allow_inf_nan=False,
                description="How much of the newest samples; no more is given than is held.",
                examples=[5.0],
            ),
        ] = 5.0,
    ) -> Response:
        """The newest samples of a shaft's motion in its bearing: whole, and 1× alone."""
        context.bearing(unit, bearing)
        settings, watched = context.unit(unit), context.references.bearing(unit, bearing)
        if isinstance(settings.source, ModbusVectorSettings):
            detail = f"unit {unit!r} is read from a rack that gives amplitudes, not samples"
            raise ProblemError(409, "No samples", detail)
        blocks, age_s = context.live.blocks(unit), context.live.data_age_s(unit)
        if not blocks or age_s is None:
            raise ProblemError(409, "No samples", f"no sample of unit {unit!r} has arrived yet")
        _require_few(seconds, blocks[-1].rate_hz)
        origin = MotionOrigin(age_s=age_s)
        return await rendered(lambda: _newest(settings, watched, blocks, seconds, origin))

    return router


def recorded_motion_router(context: Context) -> APIRouter:
    """The route of the motion in recordings."""
    router = APIRouter(
        prefix="/api/v1/recordings", tags=["recordings"], dependencies=[needs(Permission.READ)]
    )

    @router.get(
        "/{recording}/motion",
        summary="Motion of the shaft in a recording",
        responses=RECORDING_PROBLEMS,
        response_model=MotionModel,
    )
    async def motion(
        recording: RecordingId,
        bearing: Annotated[
            str, Query(max_length=32, description="Which bearing's shaft.", examples=["UJB"])
        ],
        start_s: Annotated[
            float,
            Query(
                ge=0.0,
                le=1e7,
                allow_inf_nan=False,
                description="From the first sample of the recording.",
                examples=[30.0],
            ),
        ] = 0.0,
        seconds: Annotated[
            float,
            Query(gt=0.0, le=MAX_SECONDS, allow_inf_nan=False, description="For how long."),
        ] = 10.0,
    ) -> Response:
        """Samples of a shaft's motion in its bearing at some time of a recording.

        They are read with the calibration of the recording. Behind a restart of the device the
        count begins anew, and the answer ends before it.
        """
        kept = await worked(lambda: shelf_of(context).one(recording))
        if kept is None:
            raise unknown_recording(recording)
        unit = _unit_of(context, kept)
        context.bearing(unit, bearing)
        watched = context.references.bearing(unit, bearing)
        if kept.manifest is not None:
            _require_few(seconds, kept.manifest.rate_hz)
        try:
            return await rendered(lambda: _recorded(context, kept.name, watched, start_s, seconds))
        except NoMotionError as error:
            detail = f"recording {recording}: {error}"
            raise ProblemError(409, "No samples", detail) from error
        except ConfigError as error:
            raise damaged_recording(recording, error) from error

    return router


def _newest(
    settings: UnitSettings,
    bearing: Bearing,
    blocks: Sequence[SampleBlock],
    seconds: float,
    origin: MotionOrigin,
) -> MotionModel:
    machine = machine_of(settings)
    ids = [channel.id for channel in machine.channels]
    rows = {id_: ids.index(id_) for id_ in channels_for(machine, bearing)}
    held, first_index, n_samples = newest_of(blocks, seconds)
    found = motion_of(stretch_of(held, rows, first_index, n_samples), machine, bearing)
    return motion_model(settings.id, bearing, found, origin)


def _recorded(
    context: Context, name: str, bearing: Bearing, start_s: float, seconds: float
) -> MotionModel:
    recording = shelf_of(context).opened(name)
    unit = recording.manifest.unit
    machine = machine_of(context.unit(unit))
    found = recorded_motion(recording, machine, bearing, start_s, seconds)
    origin = MotionOrigin(recording=name, offset_s=found.offset_s, total_s=found.total_s)
    return motion_model(unit, bearing, found.motion, origin)


def _unit_of(context: Context, kept: Kept) -> str:
    if kept.manifest is None:
        raise damaged_recording(kept.name, ConfigError(kept.fault or "no manifest"))
    if kept.manifest.unit not in context.units:
        detail = f"recording {kept.name} is of unit {kept.manifest.unit!r}, which is not here"
        raise ProblemError(409, "No samples", detail)
    return kept.manifest.unit


def _require_few(seconds: float, rate_hz: float) -> None:
    if seconds * rate_hz > MAX_SAMPLES:
        detail = f"{seconds:g} s are too much, at most {MAX_SAMPLES / rate_hz:g} s"
        raise ProblemError(422, "Wrong parameter", detail, "seconds")
