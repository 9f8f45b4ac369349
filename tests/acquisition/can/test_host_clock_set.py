"""The clock of the host is set while a device sends: that is no loss of samples."""

import asyncio

import can
import pytest
from rigs.tiers import covering

from acquisition.can.source import CanSource

HOST_NS = 1_767_225_600 * 10**9
RATE_HZ = 600.0
N_PER_BATCH = 50
PATIENCE_S = 20.0
"""Longer than a machine under load takes; samples that are held back never come."""


class SetClock:
    """The host's clock is off by what somebody sets; the steady one is not."""

    def __init__(self) -> None:
        self.steady_s, self.off_s = 1000.0, 0.0

    def now_ns(self) -> int:
        return HOST_NS + round((self.steady_s + self.off_s) * 1e9)

    def monotonic_s(self) -> float:
        return self.steady_s


@pytest.fixture
def plant(request, settings_of, counts_calibration, fake_bus):
    """A message with or without a counter, and a sample that is its own number."""
    clock, n_bits = SetClock(), request.param
    counter = f' SG_ c : 0|{n_bits}@1+ (1,0) [0|0] "" N\n' if n_bits else ""
    sample = ' SG_ x : 32|16@1- (1,0) [0|0] "V" N\n'
    text = f'VERSION ""\nBU_: N\nBO_ 256 M: 6 N\n{counter}{sample}'
    settings = settings_of(text, {"x": "M.x"}, counters=("M.c",) if n_bits else ())
    calibration = counts_calibration(n_channels=1, n_slow=0)
    return CanSource(settings, calibration, clock, lambda *_: fake_bus), clock, n_bits


def frame(number: int, n_bits: int) -> can.Message:
    counter = number % (1 << n_bits) if n_bits else 0
    data = counter.to_bytes(4, "little") + (number % 2**15).to_bytes(2, "little")
    return can.Message(arbitration_id=256, is_extended_id=False, data=data)


@pytest.mark.parametrize(
    ("step_s", "plant"),
    covering([7200.0, 1.5, -1.5, -3600.0, -HOST_NS / 1e9], [16, 0, 32, 8]),
    indirect=["plant"],
)
async def test_a_host_clock_that_is_set_makes_no_gap_and_no_restart(plant, fake_bus, step_s):
    source, clock, n_bits = plant
    blocks, number = [], 0
    async with asyncio.timeout(PATIENCE_S), source.connect() as stream:
        for batch in range(40):
            clock.off_s = step_s if batch >= 20 else 0.0
            clock.steady_s += N_PER_BATCH / RATE_HZ
            for _ in range(N_PER_BATCH):
                fake_bus.messages.put(frame(number, n_bits))
                number += 1
            while not blocks or blocks[-1].stop_index < number:
                blocks.append(await anext(stream))
    assert {block.epoch for block in blocks} == {blocks[0].epoch}
    assert sum(block.n_samples for block in blocks) == number
    assert not any(block.rejected for block in blocks)
