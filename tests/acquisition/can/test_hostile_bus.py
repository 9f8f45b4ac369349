"""C1 to C10 over the real slcan wire: nothing false is accepted, what is lost is counted."""

import asyncio
import threading
from collections import Counter

import numpy as np
import pytest
from rigs.tiers import covering

from acquisition.daq.can_device import CanDevice
from acquisition.daq.can_slcan import SlcanPtyServer, SlcanTcpServer
from acquisition.errors import LinkError

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
        source = source_of(shape, server.endpoint, stale_after_s=0.3)
        async with source.connect() as stream:
            await Watch(stream).up_to(50)
            server.inject("freeze", 30)
            for _ in range(30):
                server.produce(1)
            with pytest.raises(LinkError, match=r"no complete sample for .* duplicate_frame"):
                await anext(stream)


async def test_a_cut_cable_is_a_lost_link_and_the_gap_is_exact(shape, device, source_of):
    async with SlcanTcpServer(device) as server:
        source = source_of(shape, server.endpoint)
        async with source.connect() as stream:
            await Watch(stream).up_to(50)
            server.inject("cut")
            with pytest.raises(LinkError, match=r"socket|disconnected"):
                await anext(stream)
        server.produce(100)  # the device's buffer holds 64
        async with source.connect() as stream:
            block = await anext(stream)
    assert (block.epoch, block.first_index) == (7, 37 * 50)
    np.testing.assert_array_equal(block.samples[0], np.arange(37 * 50, 38 * 50))


async def test_an_unplugged_serial_adapter_comes_back_without_a_thread_left(
    tmp_path, shape, device, source_of
):
    async with SlcanPtyServer(device, link=tmp_path / "adapter") as server:
        source = source_of(shape, server.endpoint, options={"sleep_after_open": 0.0})
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
        source = source_of(shape, server.endpoint)
        for _ in range(2):
            async with source.connect() as stream:
                server.produce(1)
                await anext(stream)
        while server.commands["C"] < 2:
            await asyncio.sleep(0)
    assert set(server.commands) == {"L", "C"}


async def test_a_stalled_reader_drops_frames_counts_them_and_finds_the_gap(
    shape, device, source_of
):
    """C7: the event loop is busy while frames keep coming; a bounded queue takes what it can."""
    async with SlcanTcpServer(device) as server:
        source = source_of(shape, server.endpoint, queue_frames=500)
        async with source.connect() as stream:
            watch = Watch(stream)
            await watch.up_to(50)
            while not source.refused_frames.get("queue_overflow"):
                server.produce(1)
                await asyncio.sleep(0.001)  # lets the DAQ send; the stream is not read
            while source.refused_frames:
                before = source.refused_frames["queue_overflow"]
                server.produce(3)
                await watch.up_to(device.ledger.n_samples("U1"))
                if source.refused_frames["queue_overflow"] == before:
                    break
    assert watch.lost.total() > 0
    n_stored = sum(block.n_samples for block in watch.blocks)
    assert n_stored + watch.lost.total() == device.ledger.n_samples("U1")
