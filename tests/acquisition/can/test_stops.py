"""A module that stops for a while, in simulated time: it comes back, with true times and gaps."""

import itertools

import pytest

from acquisition.can.reader import Batch
from acquisition.can.source import CanSource
from acquisition.delivery.arrival import Arrival
from acquisition.errors import LinkError
from core.samples.blocks import SampleBlock
from core.samples.gaps import Reach, restart

RATE_HZ = 60.0
STOPS_AT_S = 10.0
END_S = 90.0
RETRY_S = 1.0
NS_PER_S = 1_000_000_000


class Module:
    """A module, and the bus that is opened to it; each sample and its counter are its number.

    It stops sampling for a while. What passes while the bus is not open is lost.
    """

    def __init__(self, clock, stop_s: float) -> None:
        self.clock, self.stop_s, self.begun_ns = clock, stop_s, clock.now_ns()
        self.n_openings = self._n_sent = 0

    def time_s(self, number: int) -> float:
        """When a sample was taken."""
        at_s = number / RATE_HZ
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


async def read(source: CanSource, module: Module) -> list[SampleBlock]:
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
    calibration = counts_calibration(n_channels=1, n_slow=0, rate_hz=RATE_HZ)
    source = CanSource(settings, calibration, stepped_clock)
    module = Module(stepped_clock, stop_s)
    monkeypatch.setattr("acquisition.can.source.FrameReader", module.opened)

    blocks = await read(source, module)

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
    assert missing == pytest.approx(n_passed / NS_PER_S * RATE_HZ - n_got, abs=0.05 * RATE_HZ)
    assert stop_s * RATE_HZ <= missing + 3 < (stop_s + 1.5 + RETRY_S) * RATE_HZ
    for block in blocks:
        true_ns = module.begun_ns + module.time_s(int(block.samples[0][0])) * NS_PER_S
        assert block.start_ns == pytest.approx(true_ns, abs=0.1 * NS_PER_S)
    assert abs(blocks[-1].clock.drift_ppm or 0.0) < 500.0


def test_samples_that_were_held_up_on_their_way_are_no_pause(settings_of, assembler_by):
    text = 'VERSION ""\nBU_: N\nBO_ 256 M: 6 N\n SG_ c : 0|32@1+ (1,0) [0|0] "" N\n'
    text += ' SG_ x : 32|16@1- (1,0) [0|0] "V" N\n'
    assembler = assembler_by(settings_of(text, {"x": "M.x"}, counters=("M.c",)), RATE_HZ)
    blocks = []
    for first, arrived_s in (*((n, n / RATE_HZ) for n in range(0, 600, 6)), (600, 10.8), (630, 11)):
        n_frames = 6 if first < 600 else 30
        frames = [(256, n.to_bytes(4, "little") + bytes(2)) for n in range(first, first + n_frames)]
        at_ns = round(arrived_s * NS_PER_S)
        blocks += assembler.take(frames, at_ns, at_ns)
    assert {(block.epoch, block.rejected) for block in blocks} == {(0, ())}
    assert sum(block.n_samples for block in blocks) == blocks[-1].stop_index == 660
