from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acquisition.calibration import UnitCalibration, calibrate
from acquisition.simulated.scenario import Scenario
from acquisition.simulated.source import SimulatedSource
from acquisition.simulated.unit import SimulatedUnit
from acquisition.source import SampleSource
from core.blocks import SampleBlock

BuildUnit = Callable[..., SimulatedUnit]


async def take(
    source: SampleSource, n_blocks: int, between: Callable[[], None] = lambda: None
) -> list[SampleBlock]:
    blocks: list[SampleBlock] = []
    async with source.connect() as stream:
        async for block in stream:
            blocks.append(block)
            if len(blocks) == n_blocks:
                break
            between()
    return blocks


async def test_an_unpaced_source_goes_on_where_it_was_left(
    build_unit: BuildUnit, calibration: UnitCalibration, stepped_clock: Any, full_load: Scenario
) -> None:
    feed = build_unit(full_load)
    in_500s = replace(calibration, block_samples=500)
    source = SimulatedSource(feed, in_500s, stepped_clock, paced=False)

    blocks = await take(source, 3)
    stepped_clock.step(3600.0)
    blocks += await take(source, 2)

    assert [block.first_index for block in blocks] == [0, 500, 1000, 1500, 2000]
    assert stepped_clock.monotonic_s() == 3600.0
    expected = calibrate(build_unit(full_load).advance(2500), calibration)
    assert np.array_equal(np.concatenate([b.samples for b in blocks], axis=1), expected.samples)


@pytest.mark.parametrize(("busy_s", "finished_s"), [(0.0, 2.5), (2.0, 8.5)])
async def test_a_paced_source_delivers_samples_once_they_have_happened_and_loses_none(
    build_unit: BuildUnit,
    calibration: UnitCalibration,
    stepped_clock: Any,
    full_load: Scenario,
    busy_s: float,
    finished_s: float,
) -> None:
    """Also to a reader that is busy for longer than a block lasts."""
    in_halves = replace(calibration, block_samples=300)
    source = SimulatedSource(build_unit(full_load), in_halves, stepped_clock)

    blocks = await take(source, 5, lambda: stepped_clock.step(busy_s))

    assert [block.first_index for block in blocks] == [0, 300, 600, 900, 1200]
    assert stepped_clock.monotonic_s() == pytest.approx(finished_s)
