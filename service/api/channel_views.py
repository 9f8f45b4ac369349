"""Channels of a unit in the words of the API: settings, and how they are now."""

from typing import Any

import numpy as np

from core.arrays import SampleArray
from core.machine.channel import Measurand
from core.quality import Level, Quality, Reading, Reason, bad, missing, worst
from core.samples.blocks import SampleBlock
from service.api.channel_models import (
    ChannelsModel,
    ChannelUnit,
    SlowChannelModel,
    WaveformChannelModel,
)
from service.api.ports import LiveLook
from service.api.views import quality_model
from service.runtime.times import rfc3339
from service.settings.bearings import CHANNEL_KEYS, GAP_KEYS, OPTIONAL_CHANNEL_KEYS
from service.settings.channels import ChannelSettings, SlowChannelSettings
from service.settings.sources.devices import ModbusVectorSettings
from service.settings.units import UnitSettings

UNITS: dict[Measurand, ChannelUnit] = {
    Measurand.GAP_UM: "um",
    Measurand.DISPLACEMENT_UM: "um",
    Measurand.VELOCITY_MM_S: "mm/s",
    Measurand.ACCELERATION_M_S2: "m/s2",
    Measurand.KEY_PHASE_V: "V",
}
"""Of waveform channels, spelt as in exported recordings."""

USES = (*CHANNEL_KEYS, *OPTIONAL_CHANNEL_KEYS, *GAP_KEYS, "oil_temperature")
"""Keys of a bearing that name channels."""

UNIT_USES = ("speed_channel", "power_channel", "key_phase")
"""Those of a unit."""


def channels_model(live: LiveLook, settings: UnitSettings) -> ChannelsModel:
    """All channels of a unit, with the verdicts and readings of its newest block."""
    newest, why_not = live.newest_block(settings.id), live.why_no_samples(settings.id)
    shown = newest if why_not is None else None
    why = why_not or Reason.WAITING_FOR_DATA
    uses = _uses(settings)
    return ChannelsModel(
        unit=settings.id,
        rate_hz=settings.sampling_hz,
        time=None if newest is None else rfc3339(newest.stop_ns),
        age_s=live.data_age_s(settings.id),
        waveform=[
            _waveform(settings, channel, uses.get(channel.id, []), shown, why)
            for channel in settings.channel
        ],
        slow=[
            _slow(channel, uses.get(channel.id, []), shown, why)
            for channel in settings.slow_channel
        ],
    )


def rows_of(settings: UnitSettings, channel: str) -> list[int]:
    """Rows of a block that are about a channel; a rack gives several for each."""
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
    return WaveformChannelModel(
        id=channel.id,
        transducer=channel.transducer.value,
        unit=UNITS[channel.measurand],
        sensitivity=channel.sensitivity,
        sensitivity_unit=channel.sensitivity_unit,
        full_scale_v=channel.full_scale_v,
        ok_min_v=channel.ok_min_v,
        ok_max_v=channel.ok_max_v,
        unit_per_count=channel.unit_per_count,
        ok_min=channel.ok_min,
        ok_max=channel.ok_max,
        gain_uncertainty=channel.gain_uncertainty,
        direction=channel.sign,
        probe=channel.probe,
        used_by=used_by,
        quality=quality_model(quality),
        **_extent(settings, block, rows, quality),
    )


def _extent(
    settings: UnitSettings, block: SampleBlock | None, rows: list[int], quality: Quality
) -> dict[str, Any]:
    """Of the samples of a block; a rack's rows are amplitudes and phases, no samples."""
    has_samples = not isinstance(settings.source, ModbusVectorSettings)
    if block is None or quality.level is Level.BAD or not has_samples:
        return {"minimum": None, "maximum": None, "mean": None}
    samples: SampleArray = block.samples[rows[0]]
    mean = float(samples.mean(dtype=np.float64))
    return {"minimum": float(samples.min()), "maximum": float(samples.max()), "mean": mean}


def _slow(
    channel: SlowChannelSettings, used_by: list[str], block: SampleBlock | None, why: Reason
) -> SlowChannelModel:
    reading = missing(why) if block is None else _reading(block, channel.id)
    return SlowChannelModel(
        id=channel.id,
        unit=channel.unit,
        minimum=channel.minimum,
        maximum=channel.maximum,
        used_by=used_by,
        value=reading.value,
        quality=quality_model(reading.quality),
    )


def _reading(block: SampleBlock, channel: str) -> Reading:
    return block.slow.get(channel) or missing(Reason.NOT_MEASURED)


def _uses(settings: UnitSettings) -> dict[str, list[str]]:
    """What each channel is for."""
    found: dict[str, list[str]] = {}
    for key in UNIT_USES:
        found.setdefault(getattr(settings, key), []).append(key)
    for bearing in settings.bearing:
        for key in USES:
            found.setdefault(getattr(bearing, key), []).append(f"{bearing.id} {key}")
    return found
