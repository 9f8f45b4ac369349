"""C8: times by the interface's own clock, led to the host's; what it says wrongly is not used."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import can
import numpy as np
import pytest
from rigs.standing_clock import StandingClock

from acquisition.can.source import CanSource
from acquisition.delivery.arrival import Arrival, InterfaceClock

RATE_HZ = 600.0
BLOCK = 50
UPTIME_S = 4711.0
PATIENCE_S = 20.0
DBC = 'VERSION ""\nBU_: N\nBO_ 544 M: 8 N\n' + "".join(
    f' SG_ s{c} : {16 * c}|16@1- (1,0) [0|0] "V" N\n' for c in range(4)
)


class Adapter:
    """A module that counts nothing, at an adapter with a clock of its own, on a real bus."""

    def __init__(self, channel: str, clock: StandingClock, drift: float = 0.0) -> None:
        self._bus = can.Bus(channel=channel, interface="virtual", preserve_timestamps=True)
        self._clock = clock
        self._drift = drift
        self.n_samples = 0

    def send(self, late_s: float, stamp_of=lambda uptime_s: uptime_s, n_lost: int = 0) -> None:
        """A block that passes on the bus and is read later; the stamp told is that of its end."""
        self.n_samples += n_lost
        self._clock.s = (self.n_samples + BLOCK) / RATE_HZ + late_s
        for n in range(BLOCK):
            self.n_samples += 1
            uptime_s = UPTIME_S + self.n_samples / RATE_HZ * (1.0 + self._drift)
            samples = (self.n_samples + np.arange(4)).astype("<i2").tobytes()
            stamp_s = stamp_of(uptime_s) if n == BLOCK - 1 else uptime_s
            message = can.Message(stamp_s, 544, is_extended_id=False, data=samples)
            self._bus.send(message)

    def close(self) -> None:
        self._bus.shutdown()


@pytest.fixture
def clock() -> StandingClock:
    return StandingClock()


@pytest.fixture
def adapter_on(clock) -> Iterator[Callable[..., Adapter]]:
    """Builds adapters on a virtual bus; the drift of their clock as keyword."""
    with ExitStack() as closing:

        def build(channel: str, **drift: float) -> Adapter:
            adapter = Adapter(channel, clock, **drift)
            closing.callback(adapter.close)
            return adapter

        yield build


@pytest.fixture
def source_on(settings_of, clock, counts_calibration):
    def build(channel: str) -> CanSource:
        signals = {f"c{n}": f"M.s{n}" for n in range(4)}
        settings = settings_of(DBC, signals, channel, stamps="interface", stale_after_s=3600.0)
        return CanSource(settings, counts_calibration(n_channels=4, n_slow=0), clock)

    return build


async def taken(stream, n_samples: int) -> list:
    """What is delivered until the bus has been read so far, and nothing more comes."""
    blocks = []
    async with asyncio.timeout(PATIENCE_S):
        while not blocks or blocks[-1].stop_index < n_samples:
            blocks.append(await anext(stream))
    return blocks


@pytest.mark.parametrize("drift", [-100e-6, 0.0, 100e-6])
async def test_a_busy_host_neither_hides_nor_makes_losses_where_the_interface_stamps(
    drift, source_on, adapter_on
):
    random = np.random.default_rng(20261122)
    channel, blocks = f"busy host {drift}", []
    adapter = adapter_on(channel, drift=drift)
    async with source_on(channel).connect() as stream:
        for _ in range(80):
            adapter.send(late_s=float(random.uniform(0.003, 0.050)))
            blocks += await taken(stream, adapter.n_samples)
    assert blocks[-1].stop_index == 80 * BLOCK
    assert [r for b in blocks for r in b.rejected] == []
    assert {b.stamp_fault for b in blocks} == {None}
    assert blocks[-1].clock.n_faults == 0


async def test_the_interface_clock_finds_a_single_lost_sample_though_the_host_is_busy(
    source_on, adapter_on
):
    random = np.random.default_rng(20261122)
    channel, blocks = "lost sample", []

    async def read(stream) -> None:
        async for block in stream:
            blocks.append(block)

    adapter = adapter_on(channel)
    async with source_on(channel).connect() as stream, asyncio.TaskGroup() as tasks:
        reading = tasks.create_task(read(stream))
        n = 0
        while n < 70 or blocks[-1].stop_index < adapter.n_samples - BLOCK:
            adapter.send(float(random.uniform(0.003, 0.050)), n_lost=int(n == 50))
            n += 1
            await asyncio.sleep(0.03)
        reading.cancel()
    n_stored = sum(b.n_samples for b in blocks)
    [rejected] = [r for b in blocks for r in b.rejected]
    assert rejected.reason == "uncounted_loss"
    assert n_stored + rejected.n_samples == blocks[-1].stop_index
    assert blocks[-1].samples[0][0] == blocks[-1].first_index + 1


@pytest.mark.parametrize(
    ("stamp_of", "fault"),
    [
        (lambda uptime_s: uptime_s - 100.0, "stamp_regressed"),
        (lambda _: 0.0, "stamp_repeated"),
        (lambda _: float("nan"), "stamp_repeated"),
        (lambda uptime_s: uptime_s + 100.0, "stamp_jumped"),
    ],
)
async def test_a_stamp_that_is_wrong_is_not_used_and_told(stamp_of, fault, source_on, adapter_on):
    channel, blocks = f"wrong stamp {fault}", []
    adapter = adapter_on(channel)
    async with source_on(channel).connect() as stream:
        for n in range(10):
            adapter.send(0.0, stamp_of if n == 3 else lambda uptime_s: uptime_s)
            blocks += await taken(stream, adapter.n_samples)
    assert {b.stamp_fault for b in blocks} == {None, fault}
    assert blocks[-1].stamp_fault is None
    assert blocks[-1].clock.n_faults > 0
    assert blocks[-1].stop_index == 10 * BLOCK
    times = np.array([b.start_ns - round(b.first_index * 1e9 / RATE_HZ) for b in blocks])
    assert np.ptp(times) < 1_000_000


def test_a_clock_that_begins_anew_is_believed_from_the_second_stamp_on():
    clock = InterfaceClock()
    late = (0.0, 0.010, 0.004, 0.0, 0.020)
    old = [(100.0 + n, n + late[n]) for n in range(5)]
    new = [(0.5 + n, 5.0 + n) for n in range(3)]
    found = [clock.arrival(s, Arrival(round(r * 1e9), r)) for s, r in [*old, *new]]
    assert [fault for _, fault in found] == [None] * 5 + ["stamp_regressed", None, None]
    for n, (arrival, _) in enumerate(found):
        assert arrival.steady_s == pytest.approx(n, abs=1.3e-3)
        assert arrival.host_ns == pytest.approx(n * 1e9, abs=1.3e6)
