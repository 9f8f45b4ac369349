"""An alarm to be led through its life, and a unit with blocks to watch."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from rigs.blocks import given_block

from core.alarms.alarm import Alarm, AlarmEvent, AlarmIdentity, AlarmRule
from core.alarms.life_cycle import update
from core.alarms.operation import Action, operate
from core.limits import Judgement
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from core.quality import GOOD, Reading
from core.samples.blocks import SampleBlock
from core.units import NS_PER_S

IDS = ("sx", "sy", "bx", "by", "spare")


@pytest.fixture(scope="session")
def unit() -> Unit:
    """One bearing with gaps and oil, and a channel that belongs to none."""
    channels = tuple(Channel(id_, Measurand.GAP_UM) for id_ in IDS)
    bearing = Bearing("UJB", 1e9, *IDS[:4], 200.0, (2000.0, 2000.0), oil_temperature="oil")
    return Unit("U1", 60.0, 100.0, channels, (bearing,))


BlockOf = Callable[..., SampleBlock]


@pytest.fixture(scope="session")
def block() -> BlockOf:
    """Builds the block of a second, good unless changed."""

    def build(second: int, oil: Reading | float = 45.0, **changes: Any) -> SampleBlock:
        qualities = changes.pop("qualities", (GOOD,) * len(IDS))
        index, start_ns = second * 100, second * NS_PER_S
        samples = np.zeros((len(qualities), 100), dtype=np.float32)
        slow = {"oil": oil if isinstance(oil, Reading) else Reading(oil)} | changes.pop("slow", {})
        quality = tuple(qualities)
        return given_block("U1", 1, index, start_ns, 100.0, samples, quality, slow, **changes)

    return build


@dataclass
class Life:
    """One alarm and all its events."""

    rule: AlarmRule
    alarm: Alarm = field(
        default_factory=lambda: Alarm(AlarmIdentity("U1", "UJB", "order1_shaft_x"))
    )
    events: list[AlarmEvent] = field(default_factory=list)

    def find(self, condition: Judgement, now_ns: int) -> list[str]:
        self.alarm, events = update(self.alarm, condition, now_ns, self.rule)
        self.events += events
        return [event.change.value for event in events]

    def ask(self, action: Action, now_ns: int = 0) -> list[str]:
        self.alarm, events = operate(self.alarm, action, now_ns)
        self.events += events
        return [event.change.value for event in events]


@pytest.fixture
def life() -> Callable[..., Life]:
    """Builds an alarm by its delays and its latch."""
    return lambda on=0, off=0, latching=False: Life(AlarmRule(on, off, latching))
