"""C1, C2, C9, C10: only whole frames get in, and offered = stored + gap + rejected."""

import ast
from collections import Counter
from dataclasses import replace
from pathlib import Path

import can
import numpy as np
import pytest
from rigs.tiers import covering, first_fast

import acquisition.can
from acquisition.can.assembly import FrameAssembler
from acquisition.can.compiler import compile_plan
from acquisition.can.gate import FrameGate
from acquisition.can.settings import CanLinkSettings
from acquisition.simulated.devices.can_frames import FrameEncoder, shortened
from acquisition.simulated.devices.can_server import can_message
from acquisition.simulated.devices.can_shape import daq_settings
from core.samples.blocks import Rejection
from core.samples.ring import Ring

BLOCK = 50
START_NS = 1_767_225_600_000_000_000


def accounted(blocks) -> Counter[str]:
    """What a reader of these blocks has to conclude: stored, gap and rejected samples."""
    found: Counter[str] = Counter()
    stop = blocks[0].first_index
    for block in blocks:
        rejected = Counter({r.reason: r.n_samples for r in block.rejected})
        found += rejected
        found["gap"] += block.first_index - stop - rejected.total()
        found["stored"] += block.n_samples
        stop = block.stop_index
        assert found["gap"] >= 0
    return found


class LossyBus:
    """Takes frames of a counting plant away, and books what a perfect reader has to find."""

    def __init__(self, shape, feed, seed: int) -> None:
        self._encoder = FrameEncoder(shape)
        self._feed = feed
        self._random = np.random.default_rng(seed)
        self._n_waves = len(shape.waves)
        self._n_per_frame = shape.samples_per_frame
        self.expected: Counter[str] = Counter()
        self.n_losses = 0

    def block(self, loss: float):
        """Frames of the next block; each instant is spoilt with this probability."""
        frames = self._encoder.frames(self._feed.advance(BLOCK))
        n_heads = len(frames) - self._n_waves * (BLOCK // self._n_per_frame)
        sent = frames[:n_heads]
        for start in range(n_heads, len(frames), self._n_waves):
            instant = frames[start : start + self._n_waves]
            if self._random.random() >= loss:
                self.expected["stored"] += self._n_per_frame
                sent += instant
                continue
            self.n_losses += 1
            sent += self._spoilt(instant)
        return sent

    def _spoilt(self, instant):
        kind = self._random.choice(["gap", "incomplete_frames", "wrong_length"])
        if kind == "incomplete_frames" and self._n_waves > 1:
            kept = self._random.permutation(self._n_waves)[
                : self._random.integers(1, self._n_waves)
            ]
            self.expected["incomplete_frames"] += self._n_per_frame
            return [instant[n] for n in sorted(kept)]
        if kind == "wrong_length":
            self.expected["wrong_length"] += self._n_per_frame
            return [shortened(frame) for frame in instant]
        self.expected["gap"] += self._n_per_frame
        return []


@pytest.fixture
def assembler_of(counts_calibration):
    def build(shape, **settings):
        n_channels, n_slow = len(shape.channels), len(shape.slow)
        link = CanLinkSettings(interface="virtual", channel="none", fd=shape.fd)
        plan = compile_plan(
            daq_settings(shape, link, ("um",) * n_channels, **settings),
            counts_calibration(n_channels=n_channels, n_slow=n_slow),
        )
        assembler = FrameAssembler(plan)
        gate = FrameGate(plan, assembler.refused)

        def take(frames, arrived_ns, steady_ns=None):
            admitted = [gate.admit(can_message(frame)) for frame in frames]
            return assembler.take([f for f in admitted if f is not None], arrived_ns, steady_ns)

        assembler.take_wire = take
        return assembler

    return build


@pytest.mark.parametrize("n_losses", first_fast(1, [500, 3000]))
@pytest.mark.parametrize("n_channels", [2, 4, 12])
@pytest.mark.parametrize("fd", [False, True], ids=["classic", "fd"])
def test_thousands_of_losses_are_counted_exactly(
    fd, n_channels, n_losses, shape_of, assembler_of, counting_feed
):
    shape = shape_of(n_channels=n_channels, fd=fd)
    feed = counting_feed(n_channels=n_channels)
    bus = LossyBus(shape, feed, seed=20261121 + n_channels)
    assembler = assembler_of(shape)
    random = np.random.default_rng(1)
    blocks, batch, arrived_ns = [], bus.block(0.0), START_NS
    while bus.n_losses < n_losses:
        batch += bus.block(float(random.choice([0.0, 0.05, 0.5])))
        arrived_ns += 83_333_333
        cut = int(random.integers(0, len(batch)))
        blocks += assembler.take_wire(batch[:cut], arrived_ns)
        batch = batch[cut:]
    blocks += assembler.take_wire(batch + bus.block(0.0), arrived_ns + 83_333_333)
    for block in blocks:
        index = np.arange(block.first_index, block.stop_index)
        np.testing.assert_array_equal(block.counts[0], index % 2**15)
        assert block.side.ok.shape[0] == n_channels
        assert block.side.ok.all()
        assert block.side.slow[0, 0] == 45.0
    found = accounted(blocks)
    assert found == bus.expected
    assert blocks[0].first_index + found.total() == feed.n_samples
    assert len({block.epoch for block in blocks}) == 1


def test_late_samples_of_two_modules_are_not_released_when_one_is_unplugged(
    shape_of, assembler_of, counting_feed
):
    """They are held, because they are late, when the second module is noticed."""
    shape, feed, twin = shape_of(), counting_feed(n_channels=4), counting_feed(n_channels=4)
    encoder, other, assembler = FrameEncoder(shape), FrameEncoder(shape), assembler_of(shape)
    twin.advance(603)
    sent = [(0.0, encoder.frames(feed.advance(BLOCK))) for _ in range(12)]
    for _ in range(8):
        raw = twin.advance(BLOCK)
        mixed = other.frames(replace(raw, counts=raw.counts + 1000))
        sent.append((0.7, encoder.frames(feed.advance(BLOCK)) + mixed))
    sent += [(0.0, encoder.frames(feed.advance(BLOCK))) for _ in range(12)]
    blocks = []
    for number, (late_s, frames) in enumerate(sent):
        time_ns = START_NS + round((number / 12.0 + late_s) * 1e9)
        blocks += assembler.take_wire(frames, time_ns, time_ns)
        assert assembler.trouble or number != 19
    assert blocks[-1].stop_index == feed.n_samples
    for block in blocks:
        index = np.arange(block.first_index, block.stop_index)
        np.testing.assert_array_equal(block.counts[0], index % 2**15)


async def test_a_lost_header_never_makes_old_slow_values_new(shape_of, assembler_of, counting_feed):
    """Every message of every header is lost once; what it said is then unknown, not old."""
    shape = shape_of()
    n_heads = len(shape.messages) - len(shape.waves)
    names = [message.name for message in shape.messages][:n_heads]
    for lost, name in enumerate(names):
        feed = counting_feed(n_channels=4, slow=(1.0, 1.0))
        encoder, assembler = FrameEncoder(shape), assembler_of(shape)
        blocks = assembler.take_wire(encoder.frames(feed.advance(BLOCK)), START_NS)
        feed.slow = (2.0, 2.0)
        frames = encoder.frames(feed.advance(BLOCK))
        blocks += assembler.take_wire(frames[:lost] + frames[lost + 1 :], START_NS + 83_333_333)
        feed.slow = (3.0, 3.0)
        blocks += assembler.take_wire(encoder.frames(feed.advance(BLOCK)), START_NS + 166_666_667)
        first, *middle, last = blocks
        assert first.side.slow[:, 0].tolist() == [1.0, 1.0]
        assert last.side.slow[:, 0].tolist() == [3.0, 3.0]
        for block in middle:
            assert all(value == 2.0 or np.isnan(value) for value in block.side.slow[:, 0]), name
            assert block.side.ok.all() or name == "HEALTH"
        if name in ("HEAD", "HEALTH"):
            assert middle == []
            assert last.rejected == (Rejection("no_header", BLOCK),)
        if name.startswith("SLOW"):
            assert [np.isnan(v) for v in middle[0].side.slow[:, 0]] == [
                name == "SLOW_0",
                name == "SLOW_1",
            ]
        if name.startswith("TIME"):
            assert middle[0].start_ns - first.start_ns == 83_333_333


def test_frames_that_disagree_in_samples_are_dropped_whole(shape_of, assembler_of, counting_feed):
    shape = shape_of(n_channels=12, fd=True)
    feed = counting_feed(n_channels=12)
    encoder, assembler = FrameEncoder(shape), assembler_of(shape)
    frames = encoder.frames(feed.advance(BLOCK))
    last = frames[-1]
    frames[-1] = replace(last, data=last.data[:2] + b"\3" + last.data[3:])
    blocks = assembler.take_wire(frames, START_NS)
    blocks += assembler.take_wire(encoder.frames(feed.advance(BLOCK)), START_NS)
    assert [(b.first_index, b.stop_index) for b in blocks] == [(0, 45), (50, 100)]
    assert blocks[1].rejected == (Rejection("incomplete_frames", 5),)


async def test_memory_stays_bounded_when_a_node_is_silent(shape_of, assembler_of, counting_feed):
    shape = shape_of()
    feed = counting_feed(n_channels=4)
    encoder, assembler = FrameEncoder(shape), assembler_of(shape)
    silent = shape.waves[1].frame_id
    blocks = assembler.take_wire(encoder.frames(feed.advance(BLOCK)), START_NS)
    for n in range(1, 101):
        frames = [f for f in encoder.frames(feed.advance(BLOCK)) if f.frame_id != silent]
        blocks += assembler.take_wire(frames, START_NS + n * 83_333_333)
    assert len(assembler._sets.pending) <= 65
    blocks += assembler.take_wire(encoder.frames(feed.advance(BLOCK)), START_NS + 9 * 10**9)
    assert len(blocks) == 2
    assert blocks[1].rejected == (Rejection("incomplete_frames", 100 * BLOCK),)
    assert blocks[1].first_index == 101 * BLOCK


@pytest.mark.parametrize(("share", "fd"), covering([0.02, 0.3, 1.0], [False, True]))
def test_random_frames_of_a_mad_device_never_break_the_account(
    share, fd, shape_of, assembler_of, counts_calibration, counting_feed
):
    """Some frames have random content, and so random counters, epochs and times."""
    random = np.random.default_rng(20261121)
    shape, calibration = shape_of(n_channels=12, fd=fd), counts_calibration(n_channels=12)
    encoder, assembler = FrameEncoder(shape), assembler_of(shape)
    feed, ring = counting_feed(n_channels=12), Ring(6000)
    arrived_ns = START_NS
    for _ in range(150):
        frames = []
        for frame in encoder.frames(feed.advance(BLOCK)):
            mad = random.random() < share
            frames.append((frame.frame_id, random.bytes(len(frame.data)) if mad else frame.data))
        arrived_ns += int(random.integers(0, 200_000_000))
        for block in assembler.take(frames, arrived_ns):
            ring.write(replace(block, calibration=calibration))
        assert len(assembler._sets.pending) <= 65
    assert sum(map(len, assembler._builder.side._entries.values())) < 40_000


N_EACH = 200


@pytest.fixture(params=[False, True], ids=["classic", "fd"])
def shape(request, shape_of):
    return shape_of(fd=request.param)


@pytest.fixture
def refused() -> Counter:
    return Counter()


@pytest.fixture
def gate(shape, counts_calibration, refused) -> FrameGate:
    link = CanLinkSettings(interface="virtual", channel="none")
    settings = daq_settings(shape, link, ("um",) * 4)
    return FrameGate(compile_plan(settings, counts_calibration(n_channels=4)), refused)


@pytest.fixture
def good(shape, counting_feed):
    return can_message(FrameEncoder(shape).frames(counting_feed(n_channels=4).advance(50))[-1])


def other_length(message, random):
    return int(random.choice([n for n in range(65) if n != message.dlc]))


def another_length(message, random):
    length = other_length(message, random)
    return {"dlc": length, "data": random.bytes(length)}


CHANGES = {
    "remote": lambda *_: {"is_remote_frame": True, "data": b""},
    "remote with data": lambda *_: {"is_remote_frame": True},
    "other kind of id": lambda m, r: {"is_extended_id": True, "data": r.bytes(len(m.data))},
    "other kind of frame": lambda m, r: {"is_fd": not m.is_fd, "data": r.bytes(len(m.data))},
    "data shorter than it says": lambda m, r: {"data": r.bytes(int(r.integers(0, m.dlc)))},
    "data longer than it says": lambda m, r: {"data": r.bytes(m.dlc + int(r.integers(1, 60)))},
    "says another length": lambda m, r: {"dlc": other_length(m, r)},
    "another length": another_length,
    "error": lambda _, r: {"is_error_frame": True, "data": r.bytes(8)},
    "foreign": lambda _, r: {"arbitration_id": int(r.integers(0x200, 0x7FF))},
}
"""What is other than it should be in a frame."""

COUNTED_AS = {
    "remote": "remote_frame",
    "remote with data": "remote_frame",
    "other kind of id": "other_id_kind",
    "error": "error_frame",
    "foreign": "foreign_id",
}


@pytest.mark.parametrize("kind", CHANGES)
def test_two_hundred_of_each_kind_and_only_a_good_frame_gets_in(kind, gate, good, refused, shape):
    assert gate.admit(good) == (good.arbitration_id, bytes(good.data))
    assert refused == Counter()
    random = np.random.default_rng(20261121)
    for _ in range(N_EACH):
        message = can.Message(
            arbitration_id=good.arbitration_id,
            is_extended_id=False,
            is_fd=good.is_fd,
            data=bytes(good.data),
        )
        for name, value in CHANGES[kind](message, random).items():
            setattr(message, name, bytearray(value) if name == "data" else value)
        frame = gate.admit(message)
        assert frame is None or frame[1] is None
    other_frame = "classic_frame" if shape.fd else "fd_frame"
    usual = other_frame if kind == "other kind of frame" else "wrong_length"
    assert refused == {COUNTED_AS.get(kind, usual): N_EACH}


def test_no_code_of_the_adapter_can_send():
    """Padwatch listens only; the one thing it writes are an slcan adapter's open and close."""
    calls = {"send", "send_periodic", "_send_periodic_internal", "flush_tx_buffer"}
    for path in Path(acquisition.can.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            assert not (isinstance(node, ast.Attribute) and node.attr in calls), path
