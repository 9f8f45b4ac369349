"""What tests of every package share: a plant whose samples are their own numbers, and a clock."""

import asyncio
from collections.abc import Callable

import numpy as np
import pytest

from acquisition.calibration import ChannelCalibration, SlowCalibration, UnitCalibration
from acquisition.raw import RawBlock

NS_PER_S = 1_000_000_000


class CountingFeed:
    """A converter whose channel 0 is the sample number modulo 2**15, channel c is c ahead."""

    def __init__(
        self,
        n_channels: int = 2,
        rate_hz: float = 600.0,
        start_ns: int = 1_767_225_600 * NS_PER_S,
        slow: tuple[float, ...] = (45.0, float("nan")),
    ) -> None:
        self._n_channels = n_channels
        self._rate_hz = rate_hz
        self._start_ns = start_ns
        self.slow = slow
        self.ok = (True,) * n_channels
        self.n_samples = 0

    def advance(self, n_samples: int) -> RawBlock:
        first = self.n_samples
        self.n_samples += n_samples
        number = np.arange(first, self.n_samples) + np.arange(self._n_channels)[:, np.newaxis]
        return RawBlock(
            epoch=7,
            first_index=first,
            start_ns=self._start_ns + round(first * NS_PER_S / self._rate_hz),
            rate_hz=self._rate_hz,
            counts=(number % 2**15).astype(np.int16),
            ok=self.ok,
            slow=self.slow,
        )


def calibration_in_counts(
    n_channels: int = 2, rate_hz: float = 600.0, n_slow: int = 2
) -> UnitCalibration:
    """One engineering unit per count, everything in range."""
    channel = ChannelCalibration(32768.0, 1.0, -32768.0, 32768.0)
    slow = tuple(SlowCalibration(f"slow{i}", -1e9, 1e9) for i in range(n_slow))
    return UnitCalibration("U1", rate_hz, (channel,) * n_channels, slow)


class SteppedClock:
    """Time that stands still unless somebody sleeps or steps it."""

    def __init__(self, start_ns: int = 1_767_225_600 * NS_PER_S) -> None:
        self._start_ns = start_ns
        self._elapsed_s = 0.0

    def now_ns(self) -> int:
        return self._start_ns + round(self._elapsed_s * NS_PER_S)

    def monotonic_s(self) -> float:
        return self._elapsed_s

    async def sleep(self, duration_s: float) -> None:
        self.step(max(0.0, duration_s))
        await asyncio.sleep(0)

    def step(self, duration_s: float) -> None:
        self._elapsed_s += duration_s


@pytest.fixture
def stepped_clock() -> SteppedClock:
    return SteppedClock()


@pytest.fixture
def counting_feed() -> Callable[..., CountingFeed]:
    """Builds counting feeds; keywords as in `CountingFeed`."""
    return CountingFeed


@pytest.fixture
def counts_calibration() -> Callable[..., UnitCalibration]:
    """Builds calibrations that leave counts as they are."""
    return calibration_in_counts
