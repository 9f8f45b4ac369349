"""What a device flags, cannot give or clips is never taken for a good sample."""

import pytest
from rigs.polled import map_of, take

from acquisition.modbus.cells import Cell
from acquisition.modbus.register_map import FullScale, MapValue, RegisterMap
from core.quality import GOOD, Level, Reason


@pytest.mark.parametrize(
    ("fault", "reason", "slow_reason"),
    [
        ("flag", Reason.SENSOR_FAILURE, None),
        ("sentinel", Reason.NOT_FINITE, Reason.NOT_MEASURED),
    ],
)
async def test_what_the_device_flags_or_cannot_give_is_never_good(
    plant, fault, reason, slow_reason
) -> None:
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


async def test_a_clipped_reading_is_called_clipped(plant) -> None:
    scale = FullScale(minimum=-50.0, maximum=102.0)
    wave = MapValue(id="wave", cell=Cell(address=10), full_scale=scale)
    async with plant(RegisterMap(values=(wave,))) as (source, *_):
        blocks = await take(source, 4)

    assert [b.channel_quality[0].reason for b in blocks] == [Reason.OK] * 2 + [Reason.CLIPPED] * 2


async def test_a_slow_channel_that_the_map_lacks_is_not_measured(plant) -> None:
    only_wave = RegisterMap(values=map_of().values[:1])
    async with plant(only_wave) as (source, *_):
        [block] = await take(source, 1)

    assert block.slow["oil"].quality.reason is Reason.NOT_MEASURED
