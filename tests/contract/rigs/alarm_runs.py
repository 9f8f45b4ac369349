"""Scripted blocks through a whole runner, and the events of alarms that come of them."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from core.alarms.alarm import AlarmEvent
from core.quality import GOOD, Reason, bad
from core.samples.blocks import SampleBlock
from rigs.blocks import with_quality
from service.store.port import AlarmQuery

Make = Callable[..., Any]

PROBE = "U1:sx:channel_not_ok"
LINK = "U1:link:link_lost"
BLOCK_NS = 1_280_000_000
T0 = 1_767_225_600_000_000_000


def lost(block: SampleBlock) -> SampleBlock:
    """The block with its first probe lost."""
    return with_quality(block, (bad(Reason.SENSOR_FAILURE), GOOD, GOOD, GOOD))


def louder(block: SampleBlock, factor: float) -> SampleBlock:
    """The block with a larger vibration."""
    return replace(block, counts=block.counts * np.float32(factor))


def events(plant: Any, **wanted: Any) -> list[AlarmEvent]:
    """All stored events, oldest first."""
    found = plant.store.alarm_events(AlarmQuery(limit=10_000, **wanted))
    return [stored.event for stored in reversed(found)]


def changes(plant: Any, alarm: str) -> list[str]:
    """What has happened to an alarm, oldest first."""
    return [event.change.value for event in events(plant, alarm=alarm)]


async def play(plant: Any, scripted: Make, *connections: Sequence[Any], flush: bool = True) -> None:
    """Let unit U1 deliver what is given, to the end."""
    await asyncio.wait_for(plant.runner(U1=scripted(*connections)).run(), 60)
    if flush:
        await plant.recorder.flush()
