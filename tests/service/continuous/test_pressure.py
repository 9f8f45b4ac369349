"""Recording gives way to the analysis, after questions have, and before anything else does."""

import pytest
from rigs.capturing import block
from rigs.standing_clock import StandingClock

from service.bus import Bus
from service.continuous import pressure as module
from service.continuous.pieces import Shed
from service.continuous.pressure import Pressure


class Plant:
    """A queue to the analysis, a disk, and what others have given up already."""

    def __init__(self) -> None:
        self.clock = StandingClock()
        self.bus = Bus(100, self.clock)
        self.is_full, self.refuses_questions = False, True
        self.pressure = Pressure(self.bus, lambda: self.is_full, lambda: self.refuses_questions)


@pytest.fixture
def plant() -> Plant:
    return Plant()


async def test_blocks_that_wait_long_come_before_recording_until_they_wait_no_more(
    plant: Plant,
) -> None:
    await plant.bus.publish(block(0))
    plant.clock.s = module.BEHIND_S
    assert plant.pressure.look() is None
    plant.clock.s += 0.1
    assert plant.pressure.look() is Shed.ANALYSIS_BEHIND

    await anext(plant.bus.blocks())
    plant.bus.done()
    await plant.bus.publish(block(1))
    plant.clock.s += 0.5 * module.BEHIND_S
    assert plant.pressure.look() is Shed.ANALYSIS_BEHIND  # not well enough yet
    await anext(plant.bus.blocks())
    plant.bus.done()
    assert plant.pressure.look() is None


async def test_a_queue_that_fills_does_as_well(plant: Plant) -> None:
    for number in range(26):
        await plant.bus.publish(block(number))
    assert plant.pressure.look() is Shed.ANALYSIS_BEHIND


async def test_questions_are_given_up_before_samples_are(plant: Plant) -> None:
    plant.refuses_questions = False
    await plant.bus.publish(block(0))
    plant.clock.s = 10 * module.BEHIND_S
    assert plant.pressure.look() is None
    plant.refuses_questions = True
    assert plant.pressure.look() is Shed.ANALYSIS_BEHIND


def test_a_disk_that_is_nearly_full_takes_no_more_recordings(plant: Plant) -> None:
    plant.is_full = True
    assert plant.pressure.look() is Shed.DISK_FULL
