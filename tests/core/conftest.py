"""A small unit, and blocks made of known signals."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from rigs.blocks import given_block
from rigs.shaken_shaft import shaken

from core.arrays import ComplexArray, FloatArray
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from core.monitor.assessment import AnalysisSettings, Assessment
from core.monitor.monitor import UnitMonitor
from core.quality import GOOD, Reading, Reason, missing
from core.samples.blocks import SampleBlock

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
    """Cut signals into blocks of the unit."""

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
            index, quality = first_index + start, (GOOD,) * len(samples)
            start_ns = round(index / RATE_HZ * 1e9)
            yield given_block("U1", epoch, index, start_ns, RATE_HZ, samples, quality, slow)

    return cut


@pytest.fixture(scope="session")
def signals() -> Callable[..., FloatArray]:
    """Builds signals (4, n): shaft 60 µm and bearing 20 µm at 1×, forward, a little noise."""

    def turning(
        duration_s: float,
        noise_um: float = 0.05,
        speed_rpm: float = 92.3,
        gaps_um: tuple[float, float] = (2000.0, 2000.0),
    ) -> FloatArray:
        turn = 2 * np.pi * speed_rpm / 60 * np.arange(int(duration_s * RATE_HZ)) / RATE_HZ
        shaft = [gaps_um[0] - 60 * np.cos(turn), gaps_um[1] - 60 * np.sin(turn)]
        rows = np.array([*shaft, 20 * np.cos(turn - 0.1), 20 * np.sin(turn - 0.1)])
        return rows + noise_um * np.random.default_rng(3).normal(size=rows.shape)

    return turning


@pytest.fixture
def results(unit: Unit, blocks: BlockMaker) -> Callable[..., list[Assessment]]:
    """Results of a monitor that begins anew; keywords are those of the blocks."""

    def watch(
        signals: FloatArray, unit: Unit = unit, settings: AnalysisSettings | None = None, **cut: Any
    ) -> list[Assessment]:
        monitor = UnitMonitor(unit, settings or AnalysisSettings())
        return [found for block in blocks(signals, **cut) for found in monitor.steps(block)]

    return watch


@pytest.fixture
def recording() -> Callable[..., ComplexArray]:
    """Phasors (n_segments, 4, n_lines) of a shaft that is shaken and a bracket that answers."""
    return shaken
