"""Polled registers: a sample is a poll, missed ones count, nothing stale or flagged passes."""

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import numpy as np
import pytest

from acquisition.calibration import ChannelCalibration, SlowCalibration, UnitCalibration
from acquisition.daq.map_device import MapDevice
from acquisition.daq.tcp_server import ModbusTcpServer
from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.polled_source import PolledSettings, PolledSource
from acquisition.modbus.transport import TcpTransport
from acquisition.raw import RawBlock
from acquisition.registers.cells import Cell, NumberType
from acquisition.registers.device_time import EpochTime
from acquisition.registers.register_map import (
    FlagCheck,
    FullScale,
    MapValue,
    Meaning,
    RegisterMap,
    Signature,
)
from core.blocks import SampleBlock
from core.quality import GOOD, Level, Reason

STATUS = Cell(address=50)
BAD_IF_SET = FlagCheck(cell=STATUS, mask=0x0008, set_means=Meaning.BAD)
CHANNEL = ChannelCalibration(10.0, 100.0, -10.0, 10.0)
CALIBRATION = UnitCalibration(
    "U1", 1.0, (CHANNEL,), (SlowCalibration("oil", -50.0, 200.0),), block_samples=1
)


class Waves:
    """A converter of one channel of counts: 100 engineering units at sample 0, then 101 and on."""

    def __init__(self) -> None:
        self.n, self.value, self.oil = 0, 100.0, 45.0

    def advance(self, n_samples: int) -> RawBlock:
        first, self.n = self.n, self.n + n_samples
        counts = np.full((1, n_samples), self.value + first, dtype=np.float32)
        start_ns = (1_800_000_000 + first) * 10**9
        return RawBlock(0, first, start_ns, 1.0, counts, (True,), (self.oil,))


def map_of(**settings) -> RegisterMap:
    wave = MapValue(
        id="wave",
        cell=Cell(address=10, type=NumberType.FLOAT32),
        flags=(BAD_IF_SET,),
    )
    oil = MapValue(
        id="oil",
        cell=Cell(address=20, type=NumberType.INT16),
        scale=0.1,
        invalid_values=(0x8000,),
        flags=(BAD_IF_SET,),
    )
    return RegisterMap(**({"values": (wave, oil)} | settings))


def device_of(registers: RegisterMap) -> MapDevice:
    return MapDevice(Waves(), registers, ("wave",), CALIBRATION)


class Follower:
    """A clock on which a device lives: it produces whenever time passes."""

    def __init__(self, clock, device: MapDevice) -> None:
        self._clock, self._device, self._done = clock, device, 0

    def now_ns(self) -> int:
        return self._clock.now_ns()

    def monotonic_s(self) -> float:
        return self._clock.monotonic_s()

    async def sleep(self, duration_s: float) -> None:
        await self._clock.sleep(duration_s)
        self.catch_up()

    def step(self, duration_s: float) -> None:
        self._clock.step(duration_s)
        self.catch_up()

    def catch_up(self) -> None:
        passed = int(self._clock.monotonic_s() + 1e-6)
        self._device.produce(passed - self._done)
        self._done = passed


@pytest.fixture
def plant(stepped_clock) -> Callable:
    """A device that lives on a stepped clock, and a source that polls it once a second."""

    @asynccontextmanager
    async def build(
        registers: RegisterMap | None = None, read_as: RegisterMap | None = None, **settings
    ) -> AsyncIterator[tuple[PolledSource, MapDevice, ModbusTcpServer, Follower]]:
        registers = registers or map_of()
        device = device_of(registers)
        clock = Follower(stepped_clock, device)
        async with ModbusTcpServer(device) as server:
            transport = TcpTransport(host="127.0.0.1", port=server.port)
            source = PolledSource(
                PolledSettings(transport=transport, **({"timeout_s": 5.0} | settings)),
                read_as or registers,
                ("wave",),
                CALIBRATION,
                clock,
            )
            yield source, device, server, clock

    return build


async def take(source: PolledSource, n: int) -> list[SampleBlock]:
    async with source.connect() as stream:
        return [await anext(stream) for _ in range(n)]


async def test_each_poll_is_a_sample_with_its_slow_values(plant) -> None:
    async with plant() as (source, *_):
        blocks = await take(source, 5)

    assert [b.first_index for b in blocks] == [0, 1, 2, 3, 4]
    assert [float(b.samples[0, 0]) for b in blocks] == [100.0, 101.0, 102.0, 103.0, 104.0]
    assert all(b.slow["oil"].value == pytest.approx(45.0) for b in blocks)
    assert {b.channel_quality for b in blocks} == {(GOOD,)}
    assert np.diff([b.start_ns for b in blocks]).tolist() == [10**9] * 4


async def test_one_poll_takes_as_few_reads_as_the_plan_says(plant) -> None:
    async with plant() as (source, _, server, _):
        await take(source, 4)

    assert server.function_codes == {3: 4 * 3}


async def test_polls_that_are_overdue_are_a_jump_of_the_index_and_never_made_up(plant) -> None:
    async with plant() as (source, _, server, clock), source.connect() as stream:
        first = await anext(stream)
        clock.step(4.5)
        second = await anext(stream)
        third = await anext(stream)
        n_reads = server.function_codes[3]

    assert [b.first_index for b in (first, second, third)] == [0, 5, 6]
    assert float(second.samples[0, 0]) == 105.0
    assert n_reads == 3 * 3


@pytest.mark.parametrize("cut", [True, False])
async def test_the_index_goes_on_across_connections(plant, cut: bool) -> None:
    async with plant() as (source, _, server, clock):
        [before] = await take(source, 1)
        if cut:
            server.cut()
        clock.step(10.0)
        [after] = await take(source, 1)

    assert (before.first_index, after.first_index) == (0, 10)
    assert after.epoch == before.epoch
    assert float(after.samples[0, 0]) == 110.0


async def test_what_the_device_flags_is_never_good(plant) -> None:
    async with plant() as (source, device, *_), source.connect() as stream:
        await anext(stream)
        device.spoil("flag", 1)
        flagged = await anext(stream)
        again = await anext(stream)

    assert flagged.channel_quality[0].level is Level.BAD
    assert flagged.channel_quality[0].reason is Reason.SENSOR_FAILURE
    assert flagged.slow["oil"].value is None
    assert again.channel_quality == (GOOD,)


async def test_a_number_that_means_an_error_is_no_value(plant) -> None:
    async with plant() as (source, device, *_), source.connect() as stream:
        await anext(stream)
        device.spoil("sentinel", 1)
        spoilt = await anext(stream)

    assert spoilt.channel_quality[0].reason is Reason.NOT_FINITE
    assert spoilt.slow["oil"].value is None
    assert spoilt.slow["oil"].quality.reason is Reason.NOT_MEASURED


async def test_a_clipped_reading_is_called_clipped(plant) -> None:
    wave = MapValue(
        id="wave",
        cell=Cell(address=10),
        full_scale=FullScale(minimum=-50.0, maximum=102.0),
    )
    async with plant(RegisterMap(values=(wave,))) as (source, *_):
        blocks = await take(source, 4)

    assert [b.channel_quality[0].reason for b in blocks] == [
        Reason.OK,
        Reason.OK,
        Reason.CLIPPED,
        Reason.CLIPPED,
    ]


async def test_a_slow_channel_that_the_map_lacks_is_not_measured(plant) -> None:
    only_wave = RegisterMap(values=map_of().values[:1])
    async with plant(only_wave) as (source, *_):
        [block] = await take(source, 1)

    assert block.slow["oil"].quality.reason is Reason.NOT_MEASURED


async def test_a_device_whose_heartbeat_stands_still_is_not_connected(plant) -> None:
    registers = map_of(heartbeat=Cell(address=60))
    async with plant(registers, stale_after_s=5.0) as (source, device, _, clock):
        await take(source, 3)
        device.frozen = True
        with pytest.raises(LinkError, match="data stand still"):
            await take(source, 20)
        with pytest.raises(LinkError, match="data stand still"):
            await take(source, 1)
        device.frozen = False
        clock.step(1.0)
        assert len(await take(source, 2)) == 2


async def test_without_a_heartbeat_anything_that_changes_is_life(plant) -> None:
    async with plant(stale_after_s=5.0) as (source, device, *_):
        assert len(await take(source, 20)) == 20
        device.frozen = True
        with pytest.raises(LinkError, match="data stand still"):
            await take(source, 20)


async def test_the_device_stamps_its_polls_if_it_can(plant) -> None:
    time = EpochTime(
        seconds=Cell(address=70, type=NumberType.UINT32), parts=Cell(address=72), parts_per_s=1000.0
    )
    async with plant(map_of(time=time)) as (source, *_):
        blocks = await take(source, 3)

    assert [b.start_ns // 10**9 for b in blocks] == [1_800_000_000 + n for n in range(3)]
    assert blocks[-1].clock.offset_s is not None


async def test_a_clock_too_coarse_for_the_polls_does_not_stamp_them(plant) -> None:
    time = EpochTime(seconds=Cell(address=70, type=NumberType.UINT32))
    async with plant(map_of(time=time)) as (source, _, _, clock):
        started_ns = clock.now_ns()
        blocks = await take(source, 3)

    assert blocks[0].start_ns == started_ns
    assert blocks[-1].clock.offset_s is None


async def test_another_device_at_the_same_address_is_refused(plant) -> None:
    registers = map_of(signature=(Signature(cell=Cell(address=1), expected=42.0),))
    other = map_of(signature=(Signature(cell=Cell(address=1), expected=43.0),))
    async with plant(registers, read_as=other) as (source, *_):
        with pytest.raises(ConfigError, match="register 1 is 42, expected 43"):
            await take(source, 1)


@pytest.mark.parametrize(
    ("fault", "error", "said"),
    [
        ("exception_2", ConfigError, "illegal address"),
        ("busy", LinkError, "busy"),
        ("cut", LinkError, "closed"),
    ],
)
async def test_a_refusal_is_told_and_the_next_poll_is_its_own(plant, fault, error, said) -> None:
    async with plant() as (source, _, server, _):
        async with source.connect() as stream:
            first = await anext(stream)
            server.inject(fault)
            with pytest.raises(error, match=said):
                await anext(stream)
        [after] = await take(source, 1)

    assert after.first_index > first.first_index
    assert float(after.samples[0, 0]) == 100.0 + after.first_index


async def test_a_shifted_map_is_noticed_by_its_signature(plant) -> None:
    signature = tuple(
        Signature(cell=Cell(address=a), expected=e) for a, e in ((1, 4711.0), (2, 815.0))
    )
    async with plant(map_of(signature=signature)) as (source, _, server, _):
        server.inject("shift_map", 10)
        with pytest.raises(ConfigError, match=r"illegal address|another device"):
            await take(source, 1)


@pytest.mark.parametrize(
    ("settings", "registers", "said"),
    [
        ({"poll_period_s": 0.0}, {}, "poll_period_s is 0.0"),
        ({"poll_period_s": 40.0}, {}, "stale_after_s is 60.0, must be at least two"),
        ({}, {"min_poll_period_s": 60.0}, "poll_period_s is 1.0, the map asks for 60.0"),
        ({}, {"min_timeout_s": 6.0}, "timeout_s is 5.0, the map asks for 6.0"),
        ({"max_registers": 60}, {}, "the map reads up to 125"),
        ({}, {"values": map_of().values[1:]}, "no value for 'wave'"),
    ],
)
async def test_what_cannot_work_is_refused_before_anything_is_sent(
    plant, settings, registers, said: str
) -> None:
    with pytest.raises(ConfigError, match=said):
        async with plant(map_of(), read_as=map_of(**registers), **settings):
            pass
