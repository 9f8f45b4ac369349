"""Slow values of another device join waveforms, and losing that device loses no waveform."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager

import numpy as np
import pytest
from rigs.blocks import given_block
from rigs.registers import SlowFeed

from acquisition.clock import SystemClock
from acquisition.errors import LinkError
from acquisition.modbus.cells import Cell, NumberType
from acquisition.modbus.polled_source import PolledSettings
from acquisition.modbus.register_map import MapValue, RegisterMap
from acquisition.modbus.slow_values import JoinedSource, PolledSlowValues, without_slow
from acquisition.modbus.transport import TcpTransport
from acquisition.simulated.devices.map_device import MapDevice
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from acquisition.source import refused_frames_of
from core.quality import GOOD, Level, Reading, Reason
from core.samples.blocks import SampleBlock
from core.samples.calibration import SlowCalibration, UnitCalibration

OIL = SlowCalibration("oil", 0.0, 100.0)
REGISTERS = RegisterMap(values=(MapValue(id="oil", cell=Cell(address=0, type=NumberType.FLOAT32)),))


class Waves:
    """A source that gives a block whenever it is asked."""

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        blocks = self._blocks()
        yield blocks
        await blocks.aclose()

    async def _blocks(self):
        n = 0
        while True:
            yield given_block(
                "U1", 1, n, n, 1.0, np.zeros((1, 1), np.float32), (GOOD,), {"power": Reading(600.0)}
            )
            n += 1
            await asyncio.sleep(0)


class Bus(Waves):
    """A source that refuses frames."""

    refused_frames: Mapping[str, int] = {"duplicate": 2}


class PollingClock:
    """Gives time to others while the poller waits, and lets so many seconds pass."""

    def __init__(self, stepped_clock, step_s: float) -> None:
        self._stepped, self._step_s = stepped_clock, step_s
        self.now_ns, self.monotonic_s = stepped_clock.now_ns, stepped_clock.monotonic_s

    async def sleep(self, duration_s: float) -> None:
        self._stepped.step(min(duration_s, self._step_s))
        await asyncio.sleep(0.001)


@pytest.fixture
def plant() -> Callable:
    @asynccontextmanager
    async def build(clock=None, **settings):
        feed = SlowFeed((45.0,))
        device = MapDevice(feed, REGISTERS, (), UnitCalibration("U1", 1.0, (), (OIL,)))
        server = ModbusTcpServer(device)
        async with server:
            transport = TcpTransport(host="127.0.0.1", port=server.port)
            slow = PolledSlowValues(
                PolledSettings(transport=transport, **({"poll_period_s": 0.001} | settings)),
                REGISTERS,
                (OIL,),
                clock or SystemClock(),
            )
            yield JoinedSource(Waves(), slow), slow, feed, device, server

    return build


async def until(stream, condition) -> SampleBlock:
    async with asyncio.timeout(10.0):
        async for block in stream:
            if condition(block.slow["oil"]):
                return block
    raise AssertionError


async def test_values_of_the_other_device_join_the_blocks_from_the_first_one_on(plant):
    async with plant() as (source, _, feed, device, _), source.connect() as stream:
        first = await anext(stream)
        found = []
        for value in (55.0, None):
            feed.slow = (500.0 if value is None else value,)
            device.produce(2)
            found.append(await until(stream, lambda oil, value=value: oil.value == value))

    assert first.slow == {"power": Reading(600.0), "oil": Reading(45.0)}
    assert [block.slow["power"].value for block in found] == [600.0] * 2
    assert found[1].slow["oil"].quality.reason is Reason.OUT_OF_RANGE


async def test_a_device_that_was_never_there_costs_no_waveform(plant):
    async with plant() as (source, slow, _, _, server):
        await server.__aexit__(None, None, None)
        async with source.connect() as stream:
            block = await anext(stream)
        assert "refused" in slow.trouble
        await server.__aenter__()

    assert block.channel_quality == (GOOD,)
    assert block.slow["oil"].quality.reason is Reason.NOT_CONNECTED


async def test_a_device_that_does_not_answer_does_not_hold_up_waveforms_that_are_back(plant):
    async with plant(timeout_s=3600.0) as (source, _, _, _, server):
        async with source.connect() as stream:
            await anext(stream)
        server.inject("silent", 100)
        async with asyncio.timeout(10.0), source.connect() as stream:
            block = await anext(stream)

    assert block.slow["oil"] == Reading(45.0)  # not yet too old


async def test_while_there_are_no_waveforms_the_other_device_is_left_alone(plant):
    class Away:
        @asynccontextmanager
        async def connect(self):
            raise LinkError("10.0.0.7:502: Connection refused")
            yield

    async with plant() as (_, slow, _, _, server):
        source = JoinedSource(Away(), slow)
        for _ in range(5):
            with pytest.raises(LinkError):
                async with source.connect():
                    pass
        assert not server.function_codes


async def test_a_value_that_gets_too_old_is_missing_and_comes_back(plant, stepped_clock):
    async with (
        plant(PollingClock(stepped_clock, 0.0), stale_after_s=5.0) as (
            source,
            _,
            feed,
            device,
            server,
        ),
        source.connect() as stream,
    ):
        await anext(stream)
        await server.__aexit__(None, None, None)
        await until(stream, lambda oil: oil.value == 45.0)
        stepped_clock.step(6.0)
        lost = await until(stream, lambda oil: oil.value is None)
        await server.__aenter__()
        feed.slow = (46.0,)
        device.produce(2)
        back = await until(stream, lambda oil: oil.value is not None)

    assert lost.slow["oil"].quality.level is Level.BAD
    assert lost.slow["oil"].quality.reason in (Reason.NOT_CONNECTED, Reason.STALE)
    assert back.slow["oil"].value == 46.0


async def test_a_device_whose_values_stand_still_has_none(plant, stepped_clock):
    clock = PollingClock(stepped_clock, 1.0)
    async with (
        plant(clock, poll_period_s=1.0, stale_after_s=5.0) as (source, slow, *_),
        source.connect() as stream,
    ):
        block = await until(stream, lambda oil: oil.value is None)

    assert block.slow["oil"].quality.reason in (Reason.NOT_CONNECTED, Reason.STALE)
    assert "has not changed" in slow.trouble or "refused" in slow.trouble


async def test_a_bug_in_the_background_is_not_swallowed(plant, monkeypatch):
    async with plant() as (source, slow, *_):
        monkeypatch.setattr(slow, "_readings", lambda _: 1 // 0)
        with pytest.raises(ZeroDivisionError):
            async with source.connect():
                pass


async def test_a_bus_reports_refused_frames_also_behind_slow_values(plant):
    async with plant() as (waves, slow, *_):
        assert refused_frames_of(Bus()) == {"duplicate": 2}
        assert refused_frames_of(JoinedSource(Bus(), slow)) == {"duplicate": 2}
        assert refused_frames_of(Waves()) == {}
        assert refused_frames_of(waves) == {}


def test_a_calibration_is_divided_between_the_two_devices(counts_calibration):
    whole = counts_calibration(n_slow=3)
    ids = frozenset({"slow1"})

    assert [c.id for c in without_slow(whole, ids).slow] == ["slow0", "slow2"]
