"""C1 to C10 over the real slcan wire: nothing false is accepted, what is lost is counted."""

import asyncio
import hashlib
import itertools
import threading
from collections import Counter
from contextlib import AsyncExitStack
from dataclasses import replace

import numpy as np
import pytest
from rigs.tiers import covering, first_fast

from acquisition.delivery.blocks import BlockAssembler
from acquisition.errors import LinkError
from acquisition.simulated.devices.can_device import CanDevice
from acquisition.simulated.devices.can_server import CanBusServer
from acquisition.simulated.devices.can_slcan import SlcanPtyServer, SlcanTcpServer
from acquisition.simulated.feed import FeedEndedError

N_EACH = 200
N_CHANNELS = 4
LOSING = {"drop", "wrong_dlc", "non_hex_line", "truncated_line", "reorder"}
COUNTED_AS = {
    "repeat": "duplicate_frame",
    "wrong_dlc": "wrong_length",
    "reorder": "out_of_order_frame",
    "error_frame": "error_frame",
    "rtr": "remote_frame",
    "extended_twin": "other_id_kind",
    "non_hex_line": "malformed_line",
    "long_line": "malformed_line",
    "truncated_line": "malformed_line",
}


class Watch:
    """Reads a source and checks that every sample is its own number."""

    def __init__(self, stream) -> None:
        self._stream = stream
        self.lost: Counter[str] = Counter()
        self.stop: int | None = None
        self.blocks = []

    async def up_to(self, stop_index: int) -> None:
        while self.stop is None or self.stop < stop_index:
            block = await anext(self._stream)
            self.blocks.append(block)
            index = np.arange(block.first_index, block.stop_index)
            for c, samples in enumerate(block.samples):
                np.testing.assert_array_equal(samples, (index + c) % 2**15)
            if self.stop is not None:
                rejected = Counter({r.reason: r.n_samples for r in block.rejected})
                self.lost += rejected
                self.lost["gap"] += block.first_index - self.stop - rejected.total()
            self.stop = block.stop_index


@pytest.fixture(params=["classic", pytest.param("fd", marks=pytest.mark.long)])
def shape(request, shape_of):
    fd = request.param == "fd"
    return shape_of(n_channels=12 if fd else N_CHANNELS, fd=fd)


@pytest.fixture
def device(shape, counting_feed):
    return CanDevice(counting_feed(n_channels=len(shape.channels)), shape)


@pytest.mark.parametrize(
    ("fault", "shape"),
    covering(sorted({*COUNTED_AS, "drop", "flood"}), ["classic", "fd"]),
    indirect=["shape"],
)
async def test_two_hundred_of_each_fault_and_no_false_sample(fault, shape, device, source_of):
    async with SlcanTcpServer(device) as server:
        source = source_of(shape, server.endpoint, when_full="wait")
        async with source.connect() as stream:
            watch = Watch(stream)
            await watch.up_to(50)
            for n in range(1, N_EACH // 4 + 1):
                server.inject(fault, 4)
                server.produce(1)
                await watch.up_to(0)
                if n % 10 == 0:
                    server.produce(2)
                    await watch.up_to(device.ledger.n_samples("U1") - 50)
            server.produce(2)
            await watch.up_to(device.ledger.n_samples("U1"))
    n_stored = sum(block.n_samples for block in watch.blocks)
    assert n_stored + watch.lost.total() == device.ledger.n_samples("U1")
    found = source.refused_frames
    if fault in COUNTED_AS:
        assert found == {COUNTED_AS[fault]: N_EACH}
    else:
        assert found == {}
    lost = +watch.lost
    if fault in LOSING:
        assert set(lost) <= {"incomplete_frames", "gap", "wrong_length"}
        assert 0 < lost.total() <= 2 * N_EACH * shape.samples_per_frame
    else:
        assert lost == Counter()


async def test_a_device_that_repeats_itself_for_ever_is_stale(shape, device, source_of):
    async with SlcanTcpServer(device) as server:
        source = source_of(shape, server.endpoint, stale_after_s=3.0)
        async with source.connect() as stream:
            await Watch(stream).up_to(50)
            server.inject("freeze", 30)
            for _ in range(30):
                server.produce(1)
            with pytest.raises(LinkError, match=r"no complete sample for .* duplicate_frame"):
                await anext(stream)


async def test_an_unplugged_serial_adapter_leaves_no_thread(tmp_path, shape, device, source_of):
    async with SlcanPtyServer(device, link=tmp_path / "adapter") as server:
        source = source_of(
            shape, server.endpoint, options={"sleep_after_open": 0.0}, when_full="wait"
        )
        for n in range(1, 6):
            async with source.connect() as stream:
                server.produce(1)
                await Watch(stream).up_to(50 * n)
                server.inject("cut")
                with pytest.raises(LinkError):
                    await Watch(stream).up_to(1_000_000)
            assert not any(t.name.startswith("can ") for t in threading.enumerate())


async def test_padwatch_sends_nothing_but_open_and_close(shape, device, source_of):
    async with SlcanTcpServer(device) as server:
        source = source_of(shape, server.endpoint, when_full="wait")
        for n in range(1, 3):
            async with source.connect() as stream:
                server.produce(1)
                await anext(stream)
            while server.commands["C"] < n:  # else the next frames go to the closed connection
                await asyncio.sleep(0)
    assert set(server.commands) == {"L", "C"}


async def test_a_stalled_reader_drops_and_counts_frames_and_finds_the_gap(shape, device, source_of):
    """C7: the event loop is busy while frames keep coming; a bounded queue takes what it can."""

    async def produce() -> None:
        while True:
            server.produce(1)
            await asyncio.sleep(0.001)  # lets the DAQ send

    async with SlcanTcpServer(device) as server:
        source = source_of(shape, server.endpoint, queue_frames=500)
        async with source.connect() as stream:
            watch = Watch(stream)
            await watch.up_to(50)
            producing = asyncio.create_task(produce())
            while not source.refused_frames.get("queue_overflow"):
                await asyncio.sleep(0.001)  # the stream is not read
            await watch.up_to(device.ledger.n_samples("U1") + 1)
            producing.cancel()
            await watch.up_to(device.ledger.n_samples("U1"))
    assert watch.lost.total() > 0
    n_stored = sum(block.n_samples for block in watch.blocks)
    assert n_stored + watch.lost.total() == device.ledger.n_samples("U1")


N_BLOCKS = 40
MOST_BELIEVED = 200
"""Samples that may pass until it is noticed: a third of a second."""


class Twin:
    """What a second module measures; it began to count elsewhere."""

    def __init__(self, feed, ahead: int) -> None:
        self._feed, self._ahead = feed, ahead

    def advance(self, n_samples: int):
        raw = self._feed.advance(n_samples)
        counts = ((raw.counts.astype(int) + 1000) % 2**15).astype(np.int16)
        return replace(raw, first_index=raw.first_index + self._ahead, counts=counts)


async def read_to_the_end(stream) -> tuple[int, str]:
    """How many samples came until the link was given up, and why it was."""
    n_samples = 0
    try:
        async for block in stream:
            n_samples += block.n_samples
    except LinkError as error:
        return n_samples, str(error)
    raise AssertionError("the stream has ended")


@pytest.mark.parametrize(("ahead", "fd"), covering([0, 3, 60, 100_000], [True, False]))
async def test_two_modules_with_the_same_ids_are_not_believed_until_one_is_unplugged(
    fd, ahead, shape_of, source_of, counting_feed
):
    shape = shape_of(fd=fd)
    device = CanDevice(counting_feed(n_channels=4), shape)
    twin = CanDevice(Twin(counting_feed(n_channels=4), ahead), shape)
    channel = f"two senders {fd} {ahead}"
    async with AsyncExitStack() as plugs:
        server = await plugs.enter_async_context(CanBusServer(device, channel=channel))
        source = source_of(shape, server.endpoint, stale_after_s=1.0)
        async with CanBusServer(twin, channel=channel) as second, source.connect() as stream:
            reading = asyncio.create_task(read_to_the_end(stream))
            for one in (server, second):  # nothing contradicts, and the end of a block is held
                one.produce()
                await asyncio.sleep(0.2)
            for _ in range(N_BLOCKS):
                server.produce()
                second.produce()
            n_samples, reason = await reading
        assert "no plausible sample" in reason
        assert "do two devices send the same CAN ids?" in reason
        assert n_samples <= MOST_BELIEVED
        server.produce(60)  # one is unplugged: that it is alone must show first
        async with source.connect() as stream:
            block = await anext(stream)
    assert block.stop_index <= device.ledger.n_samples("U1")
    index = np.arange(block.first_index, block.stop_index)
    np.testing.assert_array_equal(block.samples[0], index % 2**15)


async def test_a_module_that_sends_each_frame_twice_is_believed(shape, device, source_of):
    async with CanBusServer(device, channel="each frame twice") as server:
        source = source_of(shape, server.endpoint)
        server.inject("repeat", N_BLOCKS * 50 * len(shape.waves))
        async with source.connect() as stream:
            server.produce(N_BLOCKS)
            watch = Watch(stream)
            await watch.up_to(N_BLOCKS * 50)
    assert watch.stop >= N_BLOCKS * 50
    assert watch.lost.total() == 0
    others = {"impossible_counter"}  # a repeated frame after a pause of a busy computer
    assert set(source.refused_frames) - others == {"duplicate_frame"}


LONG_IDS = {"extended": True, "base_id": 0x18FF0100}
KINDS = {
    "classic": {},
    "fd": {"fd": True},
    "classic, long ids": LONG_IDS,
    "fd, long ids": {"fd": True, **LONG_IDS},
}


def fingerprint(blocks) -> list[str]:
    """A hash of everything in a cell but how the host's clock stands."""
    cells = [
        b.from_sample(start, stop)
        for b in blocks
        for start, stop in itertools.pairwise([*b.side.starts.tolist(), b.n_samples])
    ]
    return [
        hashlib.sha256(
            repr(
                (
                    b.unit, b.epoch, b.first_index, b.start_ns, b.rate_hz, b.samples.tobytes(),
                    b.samples.dtype, b.samples.shape, b.channel_quality, sorted(b.slow.items()),
                    b.rejected, b.stamp_fault,
                )
            ).encode()
        ).hexdigest()
        for b in cells
    ]  # fmt: skip


def straight(feed, calibration, n_samples: int = 50) -> list:
    delivery = BlockAssembler(calibration)
    blocks = []
    try:
        while True:
            blocks += delivery.take([replace(feed.advance(n_samples), calibration=calibration)])
    except FeedEndedError:
        return blocks


@pytest.fixture
def both_ways(eventful_feed, shape_of, source_of, counts_calibration, read_up_to):
    """Blocks of a feed straight from the converter, those over the wire, and what was refused."""

    async def read(feed: dict, shape: dict, n_samples: int = 50):
        direct = straight(eventful_feed(**feed), counts_calibration(n_channels=4), n_samples)
        shape = shape_of(**shape)
        device = CanDevice(eventful_feed(**feed), shape, block_samples=n_samples)
        async with SlcanTcpServer(device, on_demand=True) as server:
            source = source_of(shape, server.endpoint, when_full="wait", stale_after_s=60.0)
            wired = await read_up_to(source, direct[-1].epoch, direct[-1].stop_index)
        return direct, wired, source.refused_frames

    return read


@pytest.mark.parametrize("seed", first_fast(1, [1, 2]))
@pytest.mark.parametrize("floats", [False, True], ids=["counts", "floats"])
@pytest.mark.parametrize("fd", [False, True], ids=["classic", "fd"])
async def test_a_recording_with_gaps_and_restarts_passes_unchanged(fd, floats, seed, both_ways):
    feed, shape = {"floats": floats, "seed": seed}, {"fd": fd, "floats": floats}
    direct, wired, refused = await both_ways(feed, shape)
    assert fingerprint(wired) == fingerprint(direct)
    assert len({b.epoch for b in direct}) > 1
    assert any(a.stop_index < b.first_index for a, b in itertools.pairwise(direct))
    assert refused == {}


@pytest.mark.parametrize(("n_samples", "kind"), covering([1, 3, 48, 51], list(KINDS)))
async def test_blocks_of_any_length_come_through(kind, n_samples, both_ways):
    """Also where they end within a frame of five samples."""
    direct, wired, _ = await both_ways({"n_blocks": 200}, KINDS[kind], n_samples)
    assert fingerprint(wired) == fingerprint(direct)
