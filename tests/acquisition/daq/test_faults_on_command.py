"""Faults that an operator lets the simulated DAQ have, and what a reader sees of each."""

import numpy as np
import pytest
from rigs.modbus import transport_of

from acquisition.clock import SystemClock
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer, RtuRingServer
from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from core.blocks import Rejection
from core.device_clock import StampFault


@pytest.fixture
def device(counting_feed) -> RingDevice:
    return RingDevice(counting_feed())


@pytest.fixture(params=[ModbusRingServer, RtuRingServer], ids=["tcp", "rtu"])
async def server(request, device, tmp_path):
    extra = {"link": tmp_path / "line"} if request.param is RtuRingServer else {}
    async with request.param(device, **extra) as server:
        yield server


@pytest.fixture
def source(server, counts_calibration) -> ModbusRingSource:
    settings = ModbusRingSettings(
        transport=transport_of(server), poll_period_s=0.001, timeout_s=1.0, stale_after_s=0.3
    )
    return ModbusRingSource(settings, counts_calibration(), SystemClock())


def test_an_unknown_fault_is_refused_with_those_that_are_known(server):
    with pytest.raises(LookupError, match=r"no fault is called explode; known are .*busy.*tear"):
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


async def test_a_wrong_stamp_is_flagged(server, device, source):
    async with source.connect() as stream:
        await anext(stream)
        server.inject("wrong_time")
        device.produce(1)
        assert (await anext(stream)).stamp_fault is StampFault.JUMPED


async def test_a_reset_begins_a_new_epoch(server, source):
    async with source.connect() as stream:
        before = await anext(stream)
        server.inject("reset_epoch", 2)
        after = await anext(stream)
    assert (after.epoch, after.first_index) == (before.epoch + 2, 0)


async def test_a_frozen_device_stands_still_for_that_many_slots(server, device, source):
    async with source.connect() as stream:
        await anext(stream)
        server.inject("freeze", 5)
        device.produce(5)
        assert device.newest == 0
        with pytest.raises(LinkError, match="stand still"):
            await anext(stream)
    device.produce(1)
    async with source.connect() as stream:
        assert (await anext(stream)).first_index == 50


@pytest.mark.parametrize(
    ("fault", "error", "complaint"),
    [
        ("busy", LinkError, r"exception 6 \(busy\)"),
        ("exception", LinkError, r"exception 4 \(device failure\)"),
        ("exception_2", ConfigError, r"exception 2 \(illegal address\)"),
        ("exception_11", LinkError, "exception 11"),
        ("cut", LinkError, "closed the connection"),
        ("silent", LinkError, r"no answer within 1\.0 s"),
    ],
)
async def test_a_reply_that_fails_ends_the_connection_and_loses_nothing(
    fault, error, complaint, server, device, source
):
    async with source.connect() as stream:
        await anext(stream)
        server.inject(fault)
        device.produce(1)
        with pytest.raises(error, match=complaint):
            await anext(stream)
    async with source.connect() as stream:
        assert (await anext(stream)).first_index == 50


@pytest.mark.parametrize("fault", ["shift_map", "word_order"])
async def test_a_reply_from_a_wrong_map_is_read_again_and_never_believed(
    fault, server, device, source
):
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


async def test_each_cut_ends_one_connection(server, source):
    server.inject("cut", 2)
    for _ in range(2):
        with pytest.raises(LinkError):
            async with source.connect():
                pass
    async with source.connect() as stream:
        assert (await anext(stream)).first_index == 0
