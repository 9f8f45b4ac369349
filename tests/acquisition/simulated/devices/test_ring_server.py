"""The simulated device on the wire: paced, read-only, and with faults on command."""

import asyncio

import numpy as np
import pytest
from pymodbus.client import AsyncModbusTcpClient
from rigs.modbus import transport_of

from acquisition.clock import SystemClock
from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.ring_profile import decode_header, decode_slots
from acquisition.modbus.ring_source import RingSettings, RingSource
from acquisition.simulated.devices import ring_faults as faults
from acquisition.simulated.devices.modbus_device import RegisterMemory
from acquisition.simulated.devices.modbus_links import ModbusRtuServer, ModbusTcpServer
from acquisition.simulated.devices.ring_device import RingDevice, RingDeviceSettings
from acquisition.simulated.feed import Ledger
from core.samples.blocks import Rejection, StampFault


class Turnstile:
    """A clock that lets sleepers through only when a test turns it."""

    def __init__(self) -> None:
        self.elapsed_s = 0.0
        self._turned = asyncio.Condition()
        self.slept_s: list[float] = []

    def now_ns(self) -> int:
        return round(self.elapsed_s * 1e9)

    def monotonic_s(self) -> float:
        return self.elapsed_s

    async def sleep(self, duration_s: float) -> None:
        self.slept_s.append(duration_s)
        wake_s = self.elapsed_s + duration_s
        async with self._turned:
            self._turned.notify_all()
            await self._turned.wait_for(lambda: self.elapsed_s >= wake_s)

    async def turn(self, duration_s: float) -> None:
        """Step the time, and return when the sleeper sleeps again."""
        n_sleeps = len(self.slept_s)
        await self.step(duration_s)
        async with self._turned:
            await self._turned.wait_for(lambda: len(self.slept_s) > n_sleeps)

    async def step(self, duration_s: float) -> None:
        async with self._turned:
            self.elapsed_s += duration_s
            self._turned.notify_all()

    async def first_sleep(self) -> None:
        async with self._turned:
            await self._turned.wait_for(lambda: self.slept_s)


async def test_a_paced_device_keeps_to_the_clock_however_late_it_wakes(device):
    clock = Turnstile()
    slot_s = device.layout.slot_duration_s
    async with ModbusTcpServer(device, clock):
        await clock.first_sleep()
        for n_slots in (1.25, 0.9, 7.3, 30.05, 0.7):
            await clock.turn(n_slots * slot_s)
            n_passed = int(clock.elapsed_s / slot_s + 1e-9)
            assert device.ledger.n_samples("U1") == 50 * max(1, n_passed)


async def test_a_device_samples_on_while_nobody_serves_it(device):
    clock = Turnstile()
    server = ModbusTcpServer(device, clock)
    async with server:
        await clock.first_sleep()
    port = server.port
    clock.elapsed_s = 100 * device.layout.slot_duration_s + 0.001
    clock.slept_s.clear()
    async with server:
        await clock.first_sleep()
        assert server.port == port
        assert device.ledger.n_samples("U1") == 50 * 100


async def test_a_port_in_use_is_an_error_that_names_it(counting_feed):
    async with ModbusTcpServer(RingDevice(counting_feed())) as first:
        with pytest.raises(LinkError, match=f"cannot listen on 127.0.0.1:{first.port}"):
            async with ModbusTcpServer(RingDevice(counting_feed()), port=first.port):
                pass


async def test_what_stops_the_feed_reaches_whoever_runs_the_server(counting_feed):
    feed = counting_feed()
    device = RingDevice(feed)

    def ends(_: int):
        raise EOFError("the recording has ended")

    feed.advance = ends
    clock = Turnstile()
    async with ModbusTcpServer(device, clock) as server:
        await clock.first_sleep()
        await clock.step(9.0)
        with pytest.raises(EOFError, match="recording has ended"):
            await server.run()


@pytest.fixture
async def plain_client(counting_feed):
    """Connect pymodbus' own client to a served device: an independent reader."""
    device = RingDevice(counting_feed(), settings=RingDeviceSettings(n_slots=4))
    async with (
        ModbusTcpServer(device) as server,
        AsyncModbusTcpClient("127.0.0.1", port=server.port, retries=0) as client,
    ):
        yield client, device, server


async def test_another_modbus_client_reads_the_same_registers_and_changes_none(plain_client):
    client, device, server = plain_client
    device.produce(2)
    before = device.memory.read(0, 16)
    assert (await client.write_register(0, 1, device_id=1)).isError()
    assert server.function_codes[6] == 1
    for read in (client.read_holding_registers, client.read_input_registers):
        reply = await read(0, count=16, device_id=1)
        assert b"".join(word.to_bytes(2, "big") for word in reply.registers) == before
    assert decode_header(before).newest == 2
    reply = await client.read_holding_registers(device.layout.end_address, count=1)
    assert reply.isError()
    assert reply.exception_code == 2


def slot_in(device: RingDevice, sequence: int):
    data = device.memory.read(device.layout.slot_address(sequence), device.layout.slot_registers)
    return decode_slots(data, device.layout)[0]


def test_header_slow_values_and_slots_lie_where_the_header_says(counting_feed):
    device = RingDevice(counting_feed(), settings=RingDeviceSettings(base_address=100))
    device.produce(2)
    header = decode_header(device.memory.read(100, 16))
    assert header.layout == device.layout
    assert (header.epoch, header.newest) == (7, 2)
    slow = np.frombuffer(device.memory.read(116, 4), ">f4")
    np.testing.assert_array_equal(slow, (45.0, np.nan))
    slot = slot_in(device, 2)
    assert (slot.sequence, slot.first_index, slot.ok_bits, slot.torn) == (2, 100, 0b11, False)
    assert slot.start_ns == 1_767_225_600 * 10**9 + 166_666_000
    np.testing.assert_array_equal(slot.counts[0], np.arange(100, 150))


def test_the_ledger_books_what_was_offered_lost_or_not(counting_feed):
    ledger = Ledger()
    device = RingDevice(counting_feed(), unit="U7", ledger=ledger)
    RingDevice(counting_feed(), unit="U8", ledger=ledger)
    device.produce(3)
    device.produce(2, faults.dropped)
    device.restart()
    assert ledger.n_samples("U7", epoch=7) == 300
    assert ledger.n_samples("U7", epoch=8) == 50
    assert ledger.n_samples("U7") == 350
    assert ledger.n_samples("U8") == 50


def test_a_restarted_device_has_an_empty_ring_and_counts_from_zero(device):
    device.produce(5)
    device.restart()
    assert (device.newest, slot_in(device, 0).first_index) == (0, 0)
    assert slot_in(device, 1).blank


def test_a_ring_that_does_not_fit_into_the_address_space_is_refused(counting_feed):
    with pytest.raises(ConfigError, match="end of the ring must be"):
        RingDevice(counting_feed(n_channels=12), settings=RingDeviceSettings(n_slots=200))


def test_registers_that_do_not_exist_are_neither_written_nor_read():
    memory = RegisterMemory(100, 10)
    assert memory.read(99, 1) is None
    assert memory.read(105, 6) is None
    assert memory.read(105, 5) == bytes(10)
    with pytest.raises(ValueError, match="registers 109 to 110 are not within 100 to 109"):
        memory.write(109, bytes(4))


@pytest.fixture
def device(counting_feed) -> RingDevice:
    return RingDevice(counting_feed())


@pytest.fixture(params=[ModbusTcpServer, ModbusRtuServer], ids=["tcp", "rtu"])
async def server(request, device, tmp_path):
    extra = {"link": tmp_path / "line"} if request.param is ModbusRtuServer else {}
    async with request.param(device, **extra) as server:
        yield server


@pytest.fixture
def source(server, counts_calibration) -> RingSource:
    settings = RingSettings(
        transport=transport_of(server), poll_period_s=0.001, timeout_s=1.0, stale_after_s=0.3
    )
    return RingSource(settings, counts_calibration(), SystemClock())


def test_an_unknown_fault_is_refused_with_those_that_are_known(server):
    with pytest.raises(LookupError, match=r"unknown fault explode; known faults: .*busy.*tear"):
        server.inject("explode")


@pytest.mark.parametrize(
    ("fault", "n_slots", "reason"),
    [
        ("drop", 3, None),
        ("tear", 1, "torn_slot"),
        ("damage", 1, "damaged_slot"),
        ("repeat", 1, "inconsistent_index"),
        ("wrong_sequence", 1, "wrong_sequence"),
        ("wrong_index", 1, "inconsistent_index"),
    ],
)
async def test_a_spoilt_slot_is_refused_and_counted_a_dropped_one_is_a_gap_and_the_next_is_right(
    fault, n_slots, reason, server, device, source
):
    async with source.connect() as stream:
        await anext(stream)
        server.inject(fault, n_slots)
        device.produce(n_slots + 1)
        block = await anext(stream)
    assert block.first_index == 50 * (n_slots + 1)
    assert block.rejected == ((Rejection(reason, 50),) if reason else ())


async def test_a_wrong_stamp_is_flagged_and_a_reset_begins_a_new_epoch(server, device, source):
    async with source.connect() as stream:
        before = await anext(stream)
        server.inject("wrong_time")
        device.produce(1)
        assert (await anext(stream)).stamp_fault is StampFault.JUMPED
        server.inject("reset_epoch", 2)
        after = await anext(stream)
    assert (after.epoch, after.first_index) == (before.epoch + 2, 0)


@pytest.mark.parametrize("fault", ["shift_map", "word_order"])
async def test_a_reply_from_a_wrong_map_is_read_again_not_believed(fault, server, device, source):
    async with source.connect() as stream:
        await anext(stream)
        for _ in range(4):
            server.inject(fault)
            device.produce(1)
            block = await anext(stream)
            index = np.arange(block.first_index, block.stop_index)
            np.testing.assert_array_equal(block.samples[0], index)
    assert (block.stop_index, block.rejected) == (250, ())
    server.inject(fault, 100)
    with pytest.raises(ConfigError, match="block ring: "):
        async with source.connect():
            pass
