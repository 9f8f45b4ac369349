"""Durations are counted where they belong."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any
from unittest.mock import Mock

import pytest

from acquisition.clock import Clock
from core.samples.blocks import SampleBlock
from service.measuring.metrics import MAX_REASONS, bounded
from service.measuring.timings import Timings
from service.runtime.heartbeats import Pulse
from service.runtime.metrics import Durations
from service.runtime.polls import PollClock, TimedSource


def test_a_bound_belongs_to_its_bucket_and_nothing_is_left_out(stepped_clock: Any) -> None:
    durations = Durations((0.1, 0.2), stepped_clock)
    for duration_s in (0.0, 0.1, 0.15, 0.2, 7.0):
        durations.observe(duration_s)

    seen = durations.state()

    assert seen.n_up_to == (2, 4, 5)
    assert seen.sum_s == pytest.approx(7.45)


def test_what_fails_is_not_timed(stepped_clock: Any) -> None:
    durations = Durations((0.1,), stepped_clock)
    with pytest.raises(OSError, match="full"), durations.timed():
        raise OSError("full")
    with durations.timed():
        stepped_clock.step(3.0)

    assert durations.state().n_up_to == (0, 1)
    assert durations.state().sum_s == 3.0


@pytest.mark.parametrize("bounds", [(), (0.2, 0.1), (0.1, 0.1)])
def test_bounds_that_do_not_rise_are_refused(bounds: tuple[float, ...], stepped_clock: Any) -> None:
    with pytest.raises(ValueError, match="must increase"):
        Durations(bounds, stepped_clock)


def test_the_time_between_two_results_belongs_to_neither(stepped_clock: Any) -> None:
    timings = Timings(["U1"], stepped_clock)
    for _ in range(3):
        began_s = timings.begin()
        stepped_clock.step(0.1)
        timings.assessed("U1", began_s)
        stepped_clock.step(5.0)

    seen = timings.assessments["U1"].state()
    assert seen.n_up_to[-1] == 3
    assert seen.sum_s == pytest.approx(0.3)


async def test_a_poll_is_what_lies_between_two_waits_of_one_task(stepped_clock: Any) -> None:
    polls = PollClock(stepped_clock)

    async def poll(n_times: int, duration_s: float) -> None:
        for _ in range(n_times):
            await polls.sleep(1.0)
            stepped_clock.step(duration_s)
        await polls.sleep(1.0)

    await asyncio.create_task(poll(4, 0.25))
    await asyncio.create_task(poll(2, 0.5))

    seen = polls.polls.state()
    assert seen.n_up_to[-1] == 6
    assert seen.sum_s == pytest.approx(4 * 0.25 + 2 * 0.5)


def test_however_many_reasons_there_are_labels_stay_few() -> None:
    rejected = {f"reason_{number}": 1 for number in range(1000)} | {"a text, not a word": 5}

    counts = bounded(rejected)

    assert len(counts) == MAX_REASONS + 1
    assert sum(counts.values()) == 1005


async def test_a_source_that_is_connected_again_begins_anew(stepped_clock: Any) -> None:
    class Device:
        def __init__(self, own: Clock) -> None:
            self._own = own

        @asynccontextmanager
        async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
            yield self._deliver()

        async def _deliver(self) -> AsyncIterator[SampleBlock]:
            for _ in range(3):
                await self._own.sleep(1.0)
                stepped_clock.step(0.25)
            return
            yield

    source = TimedSource(Device, stepped_clock)
    for _ in range(2):
        async with source.connect() as blocks:
            assert [block async for block in blocks] == []
        stepped_clock.step(3600.0)  # without a link, which is no poll

    assert source.polls.state().n_up_to[-1] == 4
    assert source.polls.state().sum_s == pytest.approx(4 * 0.25)


async def test_a_driver_may_look_at_the_clock_in_a_thread_of_its_own(stepped_clock: Any) -> None:
    """As that of a CAN bus does; it says nothing of the task that reads the source."""
    pulse = Mock(spec=Pulse)
    polls = PollClock(stepped_clock)
    polls.set_pulse(pulse)
    assert await asyncio.to_thread(polls.monotonic_s) == stepped_clock.monotonic_s()
    pulse.beat.assert_not_called()
    polls.monotonic_s()
    pulse.beat.assert_called_once_with(0.0)
