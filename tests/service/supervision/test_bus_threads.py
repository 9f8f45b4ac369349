"""A source that reads in a thread of its own, as the program runs it: timed and listened to."""

import pytest
from rigs.can import CanFdRig, CanRig

from acquisition.can.source import CanSource
from acquisition.clock import SystemClock
from service.heartbeats import HeardPulse
from service.metrics.polls import TimedSource


@pytest.mark.parametrize("kind", [CanRig, CanFdRig])
async def test_the_thread_of_a_bus_may_look_at_the_clock_of_a_source_that_is_listened_to(
    kind, counting_feed, counts_calibration
) -> None:
    clock, calibration = SystemClock(), counts_calibration()
    async with kind(counting_feed(), calibration, clock) as rig:
        source = TimedSource(lambda own: CanSource(settings_of(rig), calibration, own), clock)
        source.listen(HeardPulse(clock))
        async with source.connect() as stream:
            for n in range(5):
                rig.run(rig.step_samples)
                assert (await anext(stream)).first_index == n * rig.step_samples


def settings_of(rig: CanRig):
    return rig.source._settings
