"""What a device flags, cannot give or clips is never taken for a good sample."""

from rigs.polled import map_of, take

from acquisition.registers.cells import Cell
from acquisition.registers.register_map import FullScale, MapValue, RegisterMap
from core.quality import GOOD, Level, Reason


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
