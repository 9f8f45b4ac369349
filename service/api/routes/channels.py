"""Routes for the measuring channels of a unit and their newest samples."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

import numpy as np
from fastapi import Response
from pydantic import Field

from acquisition.delivery.units import UNIT_OF
from core.arrays import SampleArray
from core.quality import Level, Reason, bad, missing, worst
from core.samples.blocks import SampleBlock
from service.api.answers import rendered
from service.api.auth.gate import GuardedRouter, subject_router
from service.api.context import Context, UnitId
from service.api.parameters import duration, several
from service.api.problems import ProblemError, problem_responses
from service.api.values import ApiModel, QualityModel, SampleRange, Time, listed
from service.live.current_state import LiveUnits
from service.live.samples import newest_blocks, sample_window
from service.live.status import HELD_S
from service.settings.bearings import CHANNEL_KEYS, GAP_KEYS, OPTIONAL_CHANNEL_KEYS
from service.settings.channels import ChannelSettings, SlowChannelSettings
from service.settings.sources.devices import ModbusVectorSettings
from service.settings.units import UnitSettings

ChannelUnit = Annotated[
    str, Field(examples=["um"], description="Engineering unit: um, mm/s, m/s2 or V.")
]


class ChannelModel(ApiModel):
    """Base class of the models of channels."""

    used_by: Annotated[list[str], Field(examples=[["UJB shaft_x"]])]
    """Uses of the channel in the plant file: bearing identifier with key of the bearing, or key of
    the unit."""

    quality: QualityModel


class WaveformChannelModel(ChannelModel):
    """Settings of a waveform channel, and its samples in the newest block."""

    settings: ChannelSettings
    unit: ChannelUnit

    direction: Literal[1, -1]
    """+1 if the reading increases with motion along the positive bearing axis, else -1."""

    minimum: float | None
    """Lowest sample of the newest block; null for a bad channel, or a device without samples."""

    maximum: float | None
    """Highest sample of the newest block; null if `minimum` is null."""

    mean: float | None
    """Mean of the newest block: for a proximity probe, the gap. Null if `minimum` is null."""


class SlowChannelModel(ChannelModel):
    """Settings and newest reading of a slow channel, such as an oil temperature."""

    settings: SlowChannelSettings

    reading: str | None
    """Name of the quantity in results and trends; null if the channel is not recorded as one."""

    value: float | None
    """Newest reading; null if and only if its quality level is bad."""


class ChannelsModel(ApiModel):
    """All channels of a unit with their current state."""

    unit: str
    rate_hz: float
    received: Time | None

    time: Time | None
    """End of the newest block of samples, even if it is not current; null without a block."""

    waveform: list[WaveformChannelModel]
    """Waveform channels, in the order of the plant file."""

    slow: list[SlowChannelModel]
    """Slow channels, in the order of the plant file."""


class ChannelSamplesModel(ApiModel):
    """Samples of one waveform channel."""

    quality: QualityModel
    unit: ChannelUnit

    sample: list[float | None]
    """Samples at consecutive indices; null if a sample is missing or the channel was bad."""


class WaveformModel(SampleRange):
    """Newest samples of the requested channels of a unit."""

    unit: str
    received: Time
    n_samples: int

    time: Time
    """Time of the first sample."""

    channels: dict[str, ChannelSamplesModel]
    """Samples of the requested channels, by identifier of the channel."""


USES = (*CHANNEL_KEYS, *OPTIONAL_CHANNEL_KEYS, *GAP_KEYS, "oil_temperature")
"""Keys of a bearing in the plant file that contain channel identifiers."""

UNIT_USES = ("speed_channel", "power_channel", "key_phase")
"""Keys of a unit in the plant file that contain channel identifiers."""


async def channels_model(live: LiveUnits, settings: UnitSettings) -> ChannelsModel:
    """Return the API model of all channels of a unit, with their state in the newest block."""
    why_not = live.why_no_samples(settings.id)
    blocks = await live.blocks(settings.id) if live.can_ask else ()
    newest = blocks[-1] if blocks else None
    shown = newest if why_not is None else None
    why, uses = why_not or Reason.WAITING_FOR_DATA, _uses(settings)
    return ChannelsModel.of(
        unit=settings.id,
        rate_hz=settings.sampling_hz,
        time=newest and newest.stop_ns,
        received=live.status(settings.id).received_ns,
        waveform=[_waveform(settings, one, uses[one.id], shown, why) for one in settings.channel],
        slow=[_slow(one, uses[one.id], shown, why) for one in settings.slow_channel],
    )


def rows_of(settings: UnitSettings, channel: str) -> list[int]:
    """Return the indices of the rows of a channel in the sample arrays of a block.

    A device that sends amplitudes in place of samples has several rows per channel.
    """
    if isinstance(settings.source, ModbusVectorSettings):
        return [n for n, row in enumerate(settings.source.rows) if row.channel == channel]
    return [n for n, each in enumerate(settings.channel) if each.id == channel]


def _waveform(
    settings: UnitSettings,
    channel: ChannelSettings,
    used_by: list[str],
    block: SampleBlock | None,
    why: Reason,
) -> WaveformChannelModel:
    rows = rows_of(settings, channel.id)
    quality = bad(why) if block is None else worst(block.channel_quality[row] for row in rows)
    has_samples = not isinstance(settings.source, ModbusVectorSettings)
    minimum = maximum = mean = None
    if block is not None and quality.level is not Level.BAD and has_samples:
        samples: SampleArray = block.samples[rows[0]]
        minimum, maximum = float(samples.min()), float(samples.max())
        mean = float(samples.mean(dtype=np.float64))
    return WaveformChannelModel.of(
        settings=channel,
        unit=UNIT_OF[channel.measurand],
        direction=channel.sign,
        used_by=used_by,
        quality=quality,
        minimum=minimum,
        maximum=maximum,
        mean=mean,
    )


def _slow(
    channel: SlowChannelSettings, used_by: list[str], block: SampleBlock | None, why: Reason
) -> SlowChannelModel:
    newest = block and block.slow.get(channel.id)
    reading = newest or missing(Reason.NOT_MEASURED if block else why)
    name = channel.recorded and channel.recorded.reading
    return SlowChannelModel.of(reading, settings=channel, used_by=used_by, reading=name)


def _uses(settings: UnitSettings) -> Mapping[str, list[str]]:
    """Return the keys of the plant file that name each channel, by channel identifier."""
    found = defaultdict[str, list[str]](list)
    for key in UNIT_USES:
        found[getattr(settings, key)].append(key)
    for bearing in settings.bearing:
        for key in USES:
            found[getattr(bearing, key)].append(f"{bearing.id} {key}")
    return found


NO_SAMPLES = problem_responses(own={409: "The unit has no samples"})
NEWEST = "Duration of the newest samples; limited to those in memory."

MAX_NUMBERS = 200_000
"""Maximum number of samples in one answer, summed over all channels."""


def channel_router(context: Context) -> GuardedRouter:
    """Return the router for channels."""
    router = subject_router("/units/{unit}", "plant")

    @router.get("/channels")
    async def channels(unit: UnitId) -> ChannelsModel:
        """List settings and state of every waveform channel and slow channel of a unit.

        The state is that of the newest block of samples; the values of a bad channel are null.
        """
        return await channels_model(context.live, context.units[unit])

    @router.get("/waveform", responses=NO_SAMPLES, response_model=WaveformModel)
    async def newest_samples(
        unit: UnitId,
        channel: Annotated[
            list[str] | None, several("Waveform channels", ["ujb_shaft_x", "ujb_shaft_y"], 32)
        ] = None,
        seconds: Annotated[float, duration(HELD_S, NEWEST)] = 2.0,
    ) -> Response:
        """Return the newest samples of a unit from memory, in engineering units.

        Missing samples and samples of a bad channel are null.
        """
        settings = context.units[unit]
        chosen = _chosen(settings, channel)
        blocks, received_ns = await held_blocks(context.live, settings)
        words = f" for {len(chosen)} channels"
        n_samples = count_of(seconds, blocks[-1].rate_hz, MAX_NUMBERS / len(chosen), words)
        rows = {each: rows_of(settings, each)[0] for each in chosen}

        def model() -> WaveformModel:
            held, first, n_held = newest_blocks(blocks, n_samples)
            window = sample_window(held, rows, first, n_held, held[-1])
            return WaveformModel.of(
                window,
                unit=unit,
                time=window.start_ns,
                received=received_ns,
                n_samples=n_held,
                channels={
                    id_: ChannelSamplesModel.of(
                        unit=UNIT_OF[channel.measurand],
                        quality=window.quality[id_],
                        sample=listed(window.samples[id_]),
                    )
                    for id_, channel in chosen.items()
                },
            )

        return await rendered(model)

    return router


async def held_blocks(live: LiveUnits, settings: UnitSettings) -> tuple[Sequence[SampleBlock], int]:
    """Return the newest blocks of a unit, oldest first, and the arrival time of the newest.

    The time is in ns since 1970 UTC. Raises a problem of status 409 before the first block, and if
    the device of the unit sends no samples.
    """
    unit = settings.id
    if isinstance(settings.source, ModbusVectorSettings):
        detail = f"unit {unit!r} has no samples, because its device sends only amplitudes"
        raise ProblemError(409, "No samples", detail)
    blocks, received_ns = await live.blocks(unit), live.status(unit).received_ns
    if not blocks or received_ns is None:
        raise ProblemError(409, "No samples", f"no sample of unit {unit!r} has arrived yet")
    return blocks, received_ns


def _chosen(settings: UnitSettings, channels: list[str] | None) -> dict[str, ChannelSettings]:
    known = {channel.id: channel for channel in settings.channel}
    for each in channels or ():
        if each not in known:
            detail = f"unknown waveform channel {each!r}; known channels: {', '.join(known)}"
            raise ProblemError(422, "Wrong parameter", detail, "channel")
    return {each: known[each] for each in channels or known}


def count_of(seconds: float, rate_hz: float, maximum: float, words: str = "") -> int:
    """Return the number of samples in a duration; raise a problem of status 422 above `maximum`.

    `words` state what the maximum applies to.
    """
    n_samples = max(1, round(seconds * rate_hz))
    if n_samples > maximum:
        detail = f"seconds must be at most {maximum / rate_hz:g}{words}, got {seconds:g}"
        raise ProblemError(422, "Wrong parameter", detail, "seconds")
    return n_samples
