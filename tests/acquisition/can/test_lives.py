"""A program begins to read again, a host clock is set, or a module stops for a while."""

import asyncio
import itertools

import can
import pytest
from rigs.standing_clock import SetClock
from rigs.tiers import covering

from acquisition.can.assembly import FrameAssembler
from acquisition.can.reader import Batch
from acquisition.can.source import CanSource
from acquisition.delivery.arrival import Arrival
from acquisition.errors import LinkError
from core.samples.blocks import SampleBlock
from core.samples.gaps import Reach, restart

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


@pytest.mark.parametrize(("n_bits", "tells"), covering([32, 16, None], [True, False]))
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
    source = CanSource(settings, calibration, stepped_clock)
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
PATIENCE_S = 120.0
"""Longer than a machine under load takes; samples that are held back never come."""


@pytest.fixture
def plant(request, settings_of, counts_calibration, fake_bus):  # noqa: ARG001
    """A message with or without a counter, and a sample that is its own number."""
    clock, n_bits = SetClock(), request.param
    counter = f' SG_ c : 0|{n_bits}@1+ (1,0) [0|0] "" N\n' if n_bits else ""
    sample = ' SG_ x : 32|16@1- (1,0) [0|0] "V" N\n'
    text = f'VERSION ""\nBU_: N\nBO_ 256 M: 6 N\n{counter}{sample}'
    settings = settings_of(text, {"x": "M.x"}, counters=("M.c",) if n_bits else ())
    calibration = counts_calibration(n_channels=1, n_slow=0)
    return CanSource(settings, calibration, clock), clock, n_bits


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


STOPPING_RATE_HZ = 60.0
STOPS_AT_S = 10.0
END_S = 90.0
RETRY_S = 1.0


class Module:
    """A module, and the bus that is opened to it; each sample and its counter are its number.

    It stops sampling for a while. What passes while the bus is not open is lost.
    """

    def __init__(self, clock, stop_s: float) -> None:
        self.clock, self.stop_s, self.begun_ns = clock, stop_s, clock.now_ns()
        self.n_openings = self._n_sent = 0

    def time_s(self, number: int) -> float:
        """When a sample was taken."""
        at_s = number / STOPPING_RATE_HZ
        return at_s + self.stop_s * (at_s >= STOPS_AT_S)

    def opened(self, *_args, **_settings) -> "Module":
        return self

    async def start(self) -> None:
        self.n_openings += 1
        self._taken()

    async def stop(self) -> None:
        pass

    async def next_batch(self, timeout_s: float) -> Batch | None:
        self.clock.step(max(0.001, min(0.047, timeout_s)))
        numbers = self._taken()
        frames = [(256, n.to_bytes(4, "little") + n.to_bytes(2, "little")) for n in numbers]
        return Batch(frames, Arrival.now(self.clock)) if frames else None

    def _taken(self) -> range:
        first = self._n_sent
        while self.time_s(self._n_sent) < self.clock.monotonic_s():
            self._n_sent += 1
        return range(first, self._n_sent)


async def read_to_end(source: CanSource, module: Module) -> list[SampleBlock]:
    """All blocks until the end; a lost link is tried again, as the service does."""
    blocks = []
    while module.clock.monotonic_s() < END_S:
        try:
            async with source.connect() as stream:
                async for block in stream:
                    blocks.append(block)
                    if block.sampled_s > END_S:
                        return blocks
        except LinkError:
            module.clock.step(RETRY_S)
    return blocks


@pytest.mark.parametrize("stop_s", [0.7, 5.0])
@pytest.mark.parametrize("counters", [(), ("M.c",)], ids=["uncounted", "counted"])
async def test_a_module_that_stops_comes_back_with_true_times_and_what_is_missing_is_estimated(
    counters, stop_s, settings_of, counts_calibration, stepped_clock, monkeypatch
):
    counter = ' SG_ c : 0|32@1+ (1,0) [0|0] "" N\n' if counters else ""
    text = f'VERSION ""\nBU_: N\nBO_ 256 M: 6 N\n{counter} SG_ x : 32|16@1- (1,0) [0|0] "V" N\n'
    settings = settings_of(text, {"x": "M.x"}, counters=counters)
    calibration = counts_calibration(n_channels=1, n_slow=0, rate_hz=STOPPING_RATE_HZ)
    source = CanSource(settings, calibration, stepped_clock)
    module = Module(stepped_clock, stop_s)
    monkeypatch.setattr("acquisition.can.source.FrameReader", module.opened)

    blocks = await read_to_end(source, module)

    assert (module.n_openings == 1) == (stop_s < settings.stale_after_s)
    missing = 0
    for before, after in itertools.pairwise(blocks):
        if before.epoch != after.epoch:
            gap = restart(Reach(before.epoch, before.stop_index, before.stop_ns), after)
            missing += gap.n_samples if gap else 0
        elif before.stop_index < after.first_index:
            assert all(rejection.is_estimated for rejection in after.rejected)
            missing += after.first_index - before.stop_index
        else:
            assert after.samples[0][0] == before.samples[0][-1] + 1
    n_passed = blocks[-1].stop_ns - blocks[0].start_ns
    n_got = sum(block.n_samples for block in blocks)
    assert missing == pytest.approx(
        n_passed / NS_PER_S * STOPPING_RATE_HZ - n_got, abs=0.05 * STOPPING_RATE_HZ
    )
    assert stop_s * STOPPING_RATE_HZ <= missing + 3 < (stop_s + 1.5 + RETRY_S) * STOPPING_RATE_HZ
    for block in blocks:
        true_ns = module.begun_ns + module.time_s(int(block.samples[0][0])) * NS_PER_S
        assert block.start_ns == pytest.approx(true_ns, abs=0.1 * NS_PER_S)
    assert abs(blocks[-1].clock.drift_ppm or 0.0) < 500.0


def test_samples_that_were_held_up_on_their_way_are_no_pause(settings_of, assembler_by):
    text = 'VERSION ""\nBU_: N\nBO_ 256 M: 6 N\n SG_ c : 0|32@1+ (1,0) [0|0] "" N\n'
    text += ' SG_ x : 32|16@1- (1,0) [0|0] "V" N\n'
    assembler = assembler_by(settings_of(text, {"x": "M.x"}, counters=("M.c",)), STOPPING_RATE_HZ)
    blocks = []
    for first, arrived_s in (
        *((n, n / STOPPING_RATE_HZ) for n in range(0, 600, 6)),
        (600, 10.8),
        (630, 11),
    ):
        n_frames = 6 if first < 600 else 30
        frames = [(256, n.to_bytes(4, "little") + bytes(2)) for n in range(first, first + n_frames)]
        at_ns = round(arrived_s * NS_PER_S)
        blocks += assembler.take(frames, at_ns, at_ns)
    assert {(block.epoch, block.rejected) for block in blocks} == {(0, ())}
    assert sum(block.n_samples for block in blocks) == blocks[-1].stop_index == 660
