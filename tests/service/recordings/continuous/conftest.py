"""A tape with its writer running, fed block by block with samples that are their own numbers."""

from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path

import pytest
from harness.waiting import at_work
from rigs.capturing import Rig, counted_block, counted_unit
from rigs.standing_clock import StandingClock

from acquisition.recordings.manifest import RecordedUnit
from service.recordings.continuous_recorder import ContinuousRecorder, DropReason
from service.recordings.segment import SegmentSettings

SETTINGS = SegmentSettings(segment_s=10.0, part_s=2.0)


class TapeRig(Rig):
    """A tape, and what is in its way."""

    def __init__(self, root: Path, units: tuple[str, ...]) -> None:
        self.root, self.clock = root, StandingClock()
        self.reason: DropReason | None = None
        recorded = {unit: counted_unit(unit) for unit in units}
        self.tape = ContinuousRecorder(root, recorded, SETTINGS, self.clock, lambda: self.reason)

    def send(self, start: int, stop: int, unit: str = "U1", **how: float) -> None:
        for number in range(start, stop):
            self.tape.take(counted_block(number, unit, **how))  # type: ignore[arg-type]


Running = Callable[..., AbstractAsyncContextManager[TapeRig]]


@pytest.fixture
def running() -> Running:
    """Runs a tape until the context is left, as the service does."""

    @asynccontextmanager
    async def run(root: Path, units: tuple[str, ...] = ("U1",)) -> AsyncIterator[TapeRig]:
        rig = TapeRig(root, units)
        async with at_work(rig.tape.run()):
            yield rig
        await rig.tape.close()

    return run


@pytest.fixture
def root(folder_in_memory: Path) -> Path:
    return folder_in_memory / "recordings"


@pytest.fixture
def unit() -> RecordedUnit:
    return counted_unit("U1")
