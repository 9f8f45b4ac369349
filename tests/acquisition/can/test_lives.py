"""A program that reads a device begins again, or the clock of its host is set."""

import asyncio

import can
import pytest
from rigs.standing_clock import SetClock
from rigs.tiers import covering

from acquisition.can.assembly import FrameAssembler
from acquisition.can.source import CanSource

RATE_HZ = 600.0
NS_PER_S = 1_000_000_000
START_NS = 1_767_225_600 * NS_PER_S
DBC = """VERSION ""
BU_: N
BO_ 256 M: 8 N
 SG_ c : 0|{n_bits}@1+ (1,0) [0|0] "" N
 SG_ e : 32|16@1+ (1,0) [0|0] "" N
 SG_ x : 48|16@1- (1,0) [0|0] "V" N
"""


@pytest.fixture
def life(settings_of, assembler_by):
    """Begins to read a device: a counter of some width or none, and whether an epoch is read."""

    def build(begun_s: float, n_bits: int | None, tells: bool) -> FrameAssembler:
        counters, epoch = ("M.c",) if n_bits else (), "M.e" if tells else None
        text = DBC.format(n_bits=n_bits or 32)
        settings = settings_of(text, {"x": "M.x"}, counters=counters, epoch=epoch)
        return assembler_by(settings, begun_ns=START_NS + round(begun_s * NS_PER_S))

    return build


def read(assembler: FrameAssembler, first: int, stop: int, n_bits: int | None, begun_at: int = 0):
    """Epochs and first index of samples of a device whose count began at one of its samples."""
    blocks = []
    for start in range(first, stop, 6):
        count = range(start - begun_at, start - begun_at + 6)
        words = [(n % (1 << (n_bits or 32)), n % 2**15) for n in count]
        frames = [
            (256, c.to_bytes(4, "little") + (7).to_bytes(2, "little") + x.to_bytes(2, "little"))
            for c, x in words
        ]
        blocks += assembler.take(frames, START_NS + round((start + 6) / RATE_HZ * NS_PER_S))
    return sorted({block.epoch for block in blocks}), blocks[0].first_index


@pytest.mark.parametrize("tells", [False, True])
@pytest.mark.parametrize("n_bits", [None, 16, 32])
def test_each_life_is_a_count_of_its_own_unless_the_device_tells_all(n_bits, tells, life):
    first, _ = read(life(0.0, n_bits, tells), 0, 6000, n_bits)
    second, index = read(life(20.0, n_bits, tells), 12_000, 18_000, n_bits)
    if tells and n_bits == 32:
        assert (first, second, index) == ([7], [7], 12_000)
    else:
        assert not {*first} & {*second}


@pytest.mark.parametrize("begun_s", [0, 3600])
async def test_the_life_of_a_source_begins_when_it_is_made(
    begun_s, settings_of, counts_calibration, fake_bus, stepped_clock
):
    settings = settings_of(DBC.format(n_bits=32), {"x": "M.x"})
    stepped_clock.step(begun_s)
    calibration = counts_calibration(n_channels=1, n_slow=0)
    source = CanSource(settings, calibration, stepped_clock, lambda *_: fake_bus)
    async with source.connect() as stream:
        for number in range(100):
            data = bytes(6) + number.to_bytes(2, "little")
            fake_bus.messages.put(can.Message(arbitration_id=256, is_extended_id=False, data=data))
        block = await anext(stream)
    assert (block.epoch, block.first_index) == (START_NS // NS_PER_S + begun_s, 0)


def test_a_restart_that_nobody_tells_is_another_count_in_each_life(life):
    found = []
    for begun_s in (0.0, 3600.0):
        assembler, at = life(begun_s, 32, True), round(begun_s * RATE_HZ)
        epochs, _ = read(assembler, at + 10**6, at + 10**6 + 600, 32)
        anew = at + 10**6 + 3000
        again, _ = read(assembler, anew, anew + 600, 32, begun_at=anew)
        found.append((epochs, again))
    assert found[0][0] == found[1][0] == [7]
    assert found[0][1] != found[1][1]


N_PER_BATCH = 50
PATIENCE_S = 20.0
"""Longer than a machine under load takes; samples that are held back never come."""


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
    covering([7200.0, 1.5, -1.5, -3600.0, -START_NS / 1e9], [16, 0, 32, 8]),
    indirect=["plant"],
)
async def test_a_host_clock_that_is_set_makes_no_gap_and_no_restart(plant, fake_bus, step_s):
    source, clock, n_bits = plant
    blocks, number = [], 0
    async with asyncio.timeout(PATIENCE_S), source.connect() as stream:
        for batch in range(40):
            clock.ns += round(step_s * 1e9) if batch == 20 else 0
            clock.step(round(N_PER_BATCH / RATE_HZ * 1e9))
            for _ in range(N_PER_BATCH):
                fake_bus.messages.put(frame(number, n_bits))
                number += 1
            while not blocks or blocks[-1].stop_index < number:
                blocks.append(await anext(stream))
    assert {block.epoch for block in blocks} == {blocks[0].epoch}
    assert sum(block.n_samples for block in blocks) == number
    assert not any(block.rejected for block in blocks)
