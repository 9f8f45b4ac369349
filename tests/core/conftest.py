"""A small unit, and blocks made of known signals."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from rigs.shaken_shaft import (
    shaken,
)

from core.arrays import ComplexArray, FloatArray
from core.blocks import SampleBlock
from core.machine import Bearing, Channel, Measurand, Unit
from core.quality import GOOD, Reading, Reason, missing

RATE_HZ = 600.0

BlockMaker = Callable[..., Iterator[SampleBlock]]


@pytest.fixture
def unit() -> Unit:
    channels = (
        Channel("sx", Measurand.GAP_UM, -1),
        Channel("sy", Measurand.GAP_UM, -1),
        Channel("bx", Measurand.DISPLACEMENT_UM),
        Channel("by", Measurand.DISPLACEMENT_UM),
    )
    bearing = Bearing("UJB", 1.18e9, "sx", "sy", "bx", "by", 200.0, (2000.0, 2000.0), "oil")
    return Unit("U1", 92.3, RATE_HZ, channels, (bearing,), "speed", "power")


@pytest.fixture
def blocks() -> BlockMaker:
    """Cut (4, n) signals into blocks of the unit."""

    def cut(
        signals: FloatArray,
        n_each: int = 60,
        first_index: int = 0,
        epoch: int = 1,
        speed_rpm: float | None = 92.3,
    ) -> Iterator[SampleBlock]:
        slow = {"power": Reading(650.0), "oil": Reading(45.0)}
        slow["speed"] = missing(Reason.OUT_OF_RANGE) if speed_rpm is None else Reading(speed_rpm)
        for start in range(0, signals.shape[1], n_each):
            samples = signals[:, start : start + n_each].astype(np.float32)
            yield SampleBlock(
                unit="U1",
                epoch=epoch,
                first_index=first_index + start,
                start_ns=round((first_index + start) / RATE_HZ * 1e9),
                rate_hz=RATE_HZ,
                samples=samples,
                channel_quality=(GOOD,) * 4,
                slow=slow,
            )

    return cut


@pytest.fixture
def recording() -> Callable[..., ComplexArray]:
    """Phasors (n_segments, 4, n_lines) of a shaft that is shaken and a bracket that answers."""
    return shaken
