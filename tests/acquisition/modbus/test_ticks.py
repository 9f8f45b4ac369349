"""Polls happen at multiples of their period, and those that are overdue are left out."""

from acquisition.modbus.ticks import Ticks


async def test_the_first_poll_does_not_wait_and_the_others_come_at_multiples(stepped_clock) -> None:
    ticks = Ticks(stepped_clock, 60.0)
    stepped_clock.step(7.0)
    started_s = stepped_clock.now_ns() // 10**9

    assert [await ticks.next() for _ in range(3)] == [0, 1, 2]
    assert stepped_clock.monotonic_s() == 7.0 + 120.0
    assert ticks.epoch == started_s
    stepped_clock.step(192.0)  # what a slow reply has missed is left out
    assert await ticks.next() == 6
    assert stepped_clock.monotonic_s() == 7.0 + 360.0
    assert await ticks.next() == 7


async def test_a_machine_that_was_suspended_while_waiting_says_the_true_tick(stepped_clock) -> None:
    ticks = Ticks(stepped_clock, 1.0)
    await ticks.next()
    asleep = stepped_clock.sleep

    async def oversleep(duration_s: float) -> None:
        await asleep(duration_s + 10.5)

    stepped_clock.sleep = oversleep
    assert await ticks.next() == 11
