"""Polled registers: a sample is a poll, missed ones count, nothing stale or flagged passes."""

import numpy as np
import pytest
from rigs.polled import map_of, take

from acquisition.delivery.polling import PollClock
from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.cells import Cell, NumberType
from acquisition.modbus.register_map import EpochTime, FullScale, MapValue, RegisterMap, Signature
from core.quality import GOOD, Level, Reason

FLOAT = Cell(address=30, type=NumberType.FLOAT32)


async def test_each_poll_is_a_sample_with_its_slow_values_in_as_few_reads_as_planned(plant):
    async with plant() as (source, _, server, _):
        blocks = await take(source, 120)

    assert [b.first_index for b in blocks] == list(range(120))
    assert [float(b.samples[0, 0]) for b in blocks] == [100.0 + n for n in range(120)]
    assert all(b.slow["oil"].value == pytest.approx(45.0) for b in blocks)
    assert {b.channel_quality for b in blocks} == {(GOOD,)}
    assert set(np.diff([b.start_ns for b in blocks])) == {10**9}
    # a device that samples when it is asked has no drift
    assert {b.clock.drift_ppm for b in blocks} == {None}
    assert server.function_codes == {3: 120 * 3}


@pytest.mark.parametrize("heartbeat", [Cell(address=60), None])
async def test_a_device_whose_heartbeat_or_without_one_everything_stands_still_is_not_connected(
    plant, heartbeat
):
    registers = map_of(heartbeat=heartbeat)
    async with plant(registers, stale_after_s=5.0) as (source, device, _, clock):
        assert len(await take(source, 20)) == 20
        device.frozen = True
        with pytest.raises(LinkError, match="the device replies, but the content of the registers"):
            await take(source, 20)
        with pytest.raises(LinkError, match="the device replies, but the content of the registers"):
            await take(source, 1)
        device.frozen = False
        clock.step(1.0)
        assert len(await take(source, 2)) == 2


async def test_the_device_stamps_its_polls_if_it_can(plant):
    time = EpochTime(
        seconds=Cell(address=70, type=NumberType.UINT32), parts=Cell(address=72), parts_per_s=1000.0
    )
    async with plant(map_of(time=time)) as (source, *_):
        blocks = await take(source, 3)

    assert [b.start_ns // 10**9 for b in blocks] == [1_800_000_000 + n for n in range(3)]
    assert blocks[-1].clock.offset_s is not None


@pytest.mark.parametrize("trouble", ["too coarse for the polls", "at zero"])
async def test_a_device_clock_that_is_no_use_does_not_stamp_polls(plant, trouble):
    cells = Cell(address=70, type=NumberType.UINT32), Cell(address=72)
    time = EpochTime(seconds=cells[0])
    if trouble == "at zero":
        time = EpochTime(seconds=cells[0], parts=cells[1], parts_per_s=1000.0)
        device = map_of(signature=tuple(Signature(cell=cell, expected=0.0) for cell in cells))
    else:
        device = map_of(time=time)
    async with plant(device, read_as=map_of(time=time)) as (source, *_, clock):
        started_ns = clock.now_ns()
        blocks = await take(source, 3)

    assert blocks[0].start_ns == started_ns
    assert blocks[-1].clock.offset_s is None


@pytest.mark.parametrize(
    ("cell", "held", "other", "said"),
    [
        (Cell(address=1), 42.0, 43.0, "register 1 is 42, expected 43"),
        (FLOAT, 0.1, 0.2, r"register 30 is 0\.1, expected 0\.2"),
    ],
)
async def test_another_device_at_the_same_address_is_refused(plant, cell, held, other, said):
    device, read_as = (
        map_of(signature=(Signature(cell=cell, expected=expected),)) for expected in (held, other)
    )
    async with plant(device) as (source, *_):
        assert len(await take(source, 1)) == 1
    async with plant(device, read_as=read_as) as (source, *_):
        with pytest.raises(ConfigError, match=said):
            await take(source, 1)
    async with plant(device) as (source, _, server, _):
        server.inject("shift_map", 10)
        with pytest.raises(ConfigError, match=r"illegal data address|wrong device"):
            await take(source, 1)


async def test_the_first_poll_does_not_wait_and_the_others_come_at_multiples(stepped_clock):
    ticks = PollClock(stepped_clock, 60.0)
    stepped_clock.step(7.0)
    started_s = stepped_clock.now_ns() // 10**9

    assert [await ticks.next() for _ in range(3)] == [0, 1, 2]
    assert stepped_clock.monotonic_s() == 7.0 + 120.0
    assert ticks.epoch == started_s
    stepped_clock.step(192.0)  # what a slow reply has missed is left out
    assert await ticks.next() == 6
    assert stepped_clock.monotonic_s() == 7.0 + 360.0
    assert await ticks.next() == 7


async def test_a_machine_that_was_suspended_while_waiting_says_the_true_tick(stepped_clock):
    ticks = PollClock(stepped_clock, 1.0)
    await ticks.next()
    asleep = stepped_clock.sleep

    async def oversleep(duration_s: float) -> None:
        await asleep(duration_s + 10.5)

    stepped_clock.sleep = oversleep
    assert await ticks.next() == 11


@pytest.mark.parametrize(
    ("fault", "reason", "slow_reason"),
    [
        ("flag", Reason.SENSOR_FAILURE, None),
        ("sentinel", Reason.NOT_FINITE, Reason.NOT_MEASURED),
    ],
)
async def test_what_a_device_flags_or_cannot_give_is_never_good(plant, fault, reason, slow_reason):
    async with plant() as (source, device, *_), source.connect() as stream:
        await anext(stream)
        device.spoil(fault, 1)
        spoilt = await anext(stream)
        again = await anext(stream)

    assert (spoilt.channel_quality[0].level, spoilt.channel_quality[0].reason) == (
        Level.BAD,
        reason,
    )
    assert spoilt.slow["oil"].value is None
    assert slow_reason in (None, spoilt.slow["oil"].quality.reason)
    assert again.channel_quality == (GOOD,)


async def test_a_clipped_reading_is_called_clipped(plant):
    scale = FullScale(minimum=-50.0, maximum=102.0)
    wave = MapValue(id="wave", cell=Cell(address=10), full_scale=scale)
    async with plant(RegisterMap(values=(wave,))) as (source, *_):
        blocks = await take(source, 4)

    assert [b.channel_quality[0].reason for b in blocks] == [Reason.OK] * 2 + [Reason.CLIPPED] * 2


async def test_a_slow_channel_that_the_map_lacks_is_not_measured(plant):
    only_wave = RegisterMap(values=map_of().values[:1])
    async with plant(only_wave) as (source, *_):
        [block] = await take(source, 1)

    assert block.slow["oil"].quality.reason is Reason.NOT_MEASURED
