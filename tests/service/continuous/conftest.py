"""A tape with its writer running, fed block by block with samples that are their own numbers."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path

import numpy as np
import pytest
from rigs.standing_clock import StandingClock

from acquisition.recording.manifest import RecordedChannel, RecordedUnit
from acquisition.recording.reader import Recording, open_recording
from core.blocks import SampleBlock
from core.machine import Measurand
from core.quality import GOOD
from service.continuous.pieces import Shed, TapeSettings
from service.continuous.tape import Tape

RATE_HZ = 50.0
BLOCK = 10
T0 = 1_767_225_600_000_000_000
SETTINGS = TapeSettings(stretch_s=10.0, part_s=2.0)


def recorded_unit(unit: str) -> RecordedUnit:
    limits = {"full_scale_v": 32768.0, "unit_per_v": 1.0, "ok_min_v": -4e4, "ok_max_v": 4e4}
    channels = tuple(
        RecordedChannel(id=id_, measurand=Measurand.DISPLACEMENT_UM, **limits) for id_ in "ab"
    )
    return RecordedUnit(
        unit=unit, rate_hz=RATE_HZ, channels=channels, slow_channels=(), block_samples=BLOCK
    )


def block_of(number: int, unit: str = "U1", epoch: int = 1, by: float = 0.0) -> SampleBlock:
    """A fifth of a second; channel a is the number of the sample."""
    first = number * BLOCK
    index = np.arange(first, first + BLOCK, dtype=np.float32) + np.float32(by)
    return SampleBlock(
        unit=unit,
        epoch=epoch,
        first_index=first,
        start_ns=T0 + number * 200_000_000,
        rate_hz=RATE_HZ,
        samples=np.array([index, -index]),
        channel_quality=(GOOD, GOOD),
    )


class Rig:
    """A tape, and what is in its way."""

    def __init__(self, root: Path, units: tuple[str, ...]) -> None:
        self.root, self.clock = root, StandingClock()
        self.reason: Shed | None = None
        self.tape = Tape(
            root,
            {unit: recorded_unit(unit) for unit in units},
            SETTINGS,
            self.clock,
            lambda: self.reason,
        )

    def send(self, start: int, stop: int, unit: str = "U1", **how: float) -> None:
        for number in range(start, stop):
            self.tape.take(block_of(number, unit, **how))  # type: ignore[arg-type]

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(30):
            while not condition():
                await asyncio.sleep(0.001)

    def recordings(self) -> list[Recording]:
        return [open_recording(folder) for folder in sorted(self.root.iterdir())]


Running = Callable[..., AbstractAsyncContextManager[Rig]]


@pytest.fixture
def running() -> Running:
    """Runs a tape until the context is left, as the service does."""

    @asynccontextmanager
    async def run(root: Path, units: tuple[str, ...] = ("U1",)) -> AsyncIterator[Rig]:
        rig = Rig(root, units)
        task = asyncio.create_task(rig.tape.run())
        yield rig
        task.cancel()
        await asyncio.wait([task])
        await rig.tape.close()

    return run


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return tmp_path / "recordings"


@pytest.fixture
def samples() -> Callable[[Recording], list[int]]:
    """The numbers of the samples in a recording."""
    return lambda recording: [int(v) for raw in recording.raw_blocks() for v in raw.counts[0]]


@pytest.fixture
def block() -> Callable[..., SampleBlock]:
    return block_of


@pytest.fixture
def unit() -> Callable[[str], RecordedUnit]:
    return recorded_unit
