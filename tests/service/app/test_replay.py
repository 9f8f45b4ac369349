"""Where replays are kept, and how one that is played through a DAQ comes to its end."""

import threading
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import pytest
from rigs.blocks import given_block

from acquisition.errors import LinkError
from core.quality import GOOD
from core.samples.blocks import DeviceClock, SampleBlock
from service.app.recordings import PlayedOut, replay_folder, replayed_plant
from service.settings.loading import load_plant_file

NEW_YEAR_NS = 1_767_225_600 * 1_000_000_000


class Standing:
    """A source whose device stands still after some blocks, as a DAQ that has played all."""

    def __init__(self, blocks, refuses: bool = False) -> None:
        self._blocks, self._refuses = blocks, refuses

    @asynccontextmanager
    async def connect(self):
        if self._refuses:
            raise LinkError("the device replies, but the newest sample has not changed")
        yield self._stream()

    async def _stream(self):
        for block in self._blocks:
            yield block
        raise LinkError("the device replies, but the newest sample has not changed")


def block(number: int, clock: DeviceClock | None = None) -> SampleBlock:
    """One sample of one channel, of long ago."""
    samples = np.full((1, 1), number, np.float32)
    return given_block("U1", 1, number, NEW_YEAR_NS, 600.0, samples, (GOOD,), clock=clock)


FIRST, SECOND = block(1), block(2)


async def taken(source) -> list[SampleBlock]:
    async with source.connect() as blocks:
        return [block async for block in blocks]


@pytest.fixture
def over() -> threading.Event:
    """The end of the recording, which has come."""
    event = threading.Event()
    event.set()
    return event


async def test_a_device_that_stands_still_after_its_recording_ends_the_stream_without_a_clock(
    over,
) -> None:
    assert await taken(PlayedOut(Standing([FIRST, SECOND]), over)) == [FIRST, SECOND]
    assert await taken(PlayedOut(Standing([], refuses=True), over)) == []
    off = DeviceClock(offset_s=-28e6, drift_ppm=5e5, u_drift_ppm=1.0)
    [played] = await taken(PlayedOut(Standing([block(1, off)]), over))
    assert played.clock is None


@pytest.mark.parametrize("refuses", [False, True], ids=["while reading", "when connecting"])
async def test_before_its_end_a_lost_link_is_lost_and_a_daq_that_is_gone_is_not_waited_for(
    over, refuses: bool
) -> None:
    daq = Standing([FIRST], refuses)
    with pytest.raises(LinkError, match="has not changed"):
        await taken(PlayedOut(daq, threading.Event()))
    gone = over
    source = PlayedOut(daq, threading.Event(), gone)
    assert await taken(source) == ([] if refuses else [FIRST])


def test_results_of_a_replay_lie_apart_under_what_was_played_and_when(deploy: Path) -> None:
    plant = load_plant_file(deploy / "demo.toml")
    folder = replay_folder(plant, [Path("runs/march"), Path("runs/april")], NEW_YEAR_NS)
    assert folder == Path("var/demo/replays/march+april-20260101T000000Z")
    played = replayed_plant(plant, ["U2"], folder)
    assert [unit.id for unit in played.unit] == ["U2"]
    assert played.service.data_folder == str(folder)
    assert plant.service.data_folder == "var/demo"
