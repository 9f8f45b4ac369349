"""The channels of a unit, and their newest samples."""

from typing import Annotated

from fastapi import APIRouter, Query, Response

from service.api.auth.declared import needs
from service.api.channel_models import ChannelsModel, WaveformModel
from service.api.channel_views import channels_model, rows_of
from service.api.context import Context, UnitId
from service.api.problems import ProblemError, described_problems, problem_responses
from service.api.rendering import rendered
from service.api.waveform_views import waveform_model
from service.live.live_view import HELD_S
from service.live.samples import newest_stretch
from service.settings.sources.devices import ModbusVectorSettings
from service.settings.units import UnitSettings
from service.store.access.identities import Permission

MAX_NUMBERS = 200_000
"""Samples of all channels together in one answer."""

PROBLEMS = described_problems(
    {404: "Unknown unit", 409: "There are no samples", 422: "A wrong parameter"}
)


def channel_router(context: Context) -> APIRouter:
    """Routes about channels."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}", tags=["plant"], dependencies=[needs(Permission.READ)]
    )

    @router.get("/channels", summary="Channels", responses=problem_responses(404))
    async def channels(unit: UnitId) -> ChannelsModel:
        """Settings and live state of every waveform channel and slow channel of a unit.

        The state is that of the newest block: a channel that is bad has no number.
        """
        return channels_model(context.live, context.unit(unit))

    @router.get("/waveform", summary="Waveform", responses=PROBLEMS, response_model=WaveformModel)
    async def waveform(
        unit: UnitId,
        channel: Annotated[
            list[str] | None,
            Query(
                max_length=32,
                description="Waveform channels; all unless given. May be repeated.",
                examples=[["ujb_shaft_x", "ujb_shaft_y"]],
            ),
        ] = None,
        seconds: Annotated[
            float,
            Query(
                gt=0.0,
                le=HELD_S,
                allow_inf_nan=False,
                description="How much of the newest samples; no more is given than is held.",
            ),
        ] = 2.0,
    ) -> Response:
        """The newest samples of a unit, straight from memory, in engineering units.

        Samples that never arrived, and those of a channel that was bad, are null.
        """
        settings = context.unit(unit)
        chosen = _chosen(settings, channel)
        blocks, age_s = context.live.blocks(unit), context.live.data_age_s(unit)
        if not blocks or age_s is None:
            raise ProblemError(409, "No samples", f"no sample of unit {unit!r} has arrived yet")
        n_samples = _n_samples(seconds, blocks[-1].rate_hz, len(chosen))
        rows = [rows_of(settings, each)[0] for each in chosen]
        return await rendered(
            lambda: waveform_model(settings, chosen, newest_stretch(blocks, rows, n_samples), age_s)
        )

    return router


def _chosen(settings: UnitSettings, channels: list[str] | None) -> list[str]:
    if isinstance(settings.source, ModbusVectorSettings):
        detail = f"unit {settings.id!r} is read from a rack that gives amplitudes, not samples"
        raise ProblemError(409, "No samples", detail)
    known = [channel.id for channel in settings.channel]
    for each in channels or ():
        if each not in known:
            detail = f"unit {settings.id!r} has no waveform channel {each!r}; see its channels"
            raise ProblemError(422, "Wrong parameter", detail, "channel")
    return list(dict.fromkeys(channels or known))


def _n_samples(seconds: float, rate_hz: float, n_channels: int) -> int:
    n_samples = max(1, round(seconds * rate_hz))
    if n_samples * n_channels > MAX_NUMBERS:
        longest_s = MAX_NUMBERS / n_channels / rate_hz
        detail = f"{seconds:g} s of {n_channels} channels are too much, at most {longest_s:g} s"
        raise ProblemError(422, "Wrong parameter", detail, "seconds")
    return n_samples
