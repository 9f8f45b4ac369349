"""A clock for replays: the same day, faster."""

import pytest

from acquisition.clock import FastClock


async def test_a_fast_clock_passes_a_day_in_a_fiftieth_of_it(stepped_clock) -> None:
    clock = FastClock(stepped_clock, 50.0)
    start_ns = clock.now_ns()
    assert start_ns == stepped_clock.now_ns()

    await clock.sleep(86_400.0)

    assert stepped_clock.monotonic_s() == pytest.approx(1728.0)
    assert clock.monotonic_s() == pytest.approx(86_400.0)
    assert clock.now_ns() - start_ns == 86_400_000_000_000


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan")])
def test_a_clock_that_does_not_run_forward_is_refused(stepped_clock, speed) -> None:
    with pytest.raises(ValueError, match="positive speed"):
        FastClock(stepped_clock, speed)
