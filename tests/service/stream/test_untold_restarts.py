"""What the stream may bring and no count explains: restarts that nobody told, impossible blocks."""

import sqlite3
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
from harness.moving_unit import Message, MovingUnit
from harness.stream_rig import found_in

from core.blocks import Rejection, SampleBlock
from core.counts import ANEW
from core.quality import GOOD, Reading
from core.units import NS_PER_S
from service.stream.wire import encoded_block

N_SAMPLES = 240
EPOCH = 3
T0 = 1_767_225_600 * NS_PER_S
MakeUnit = Callable[[str], MovingUnit]


def blocks(unit: MovingUnit, first_index: int, n: int, begin_s: float = 0.0) -> list[SampleBlock]:
    """Blocks of a device that began to count at that second."""
    settings = unit.plant.unit[0]
    rate_hz, n_channels = settings.sampling_hz, len(settings.channel)
    found = []
    for start in range(first_index, first_index + n * N_SAMPLES, N_SAMPLES):
        t_s = (start + np.arange(N_SAMPLES)) / rate_hz
        samples = 40.0 * np.cos(2 * np.pi * 10.0 * t_s) + np.zeros((n_channels, 1))
        found.append(
            SampleBlock(
                unit=settings.id,
                epoch=EPOCH,
                first_index=start,
                start_ns=T0 + round((begin_s + start / rate_hz) * NS_PER_S),
                rate_hz=rate_hz,
                samples=samples.astype(np.float32),
                channel_quality=(GOOD,) * n_channels,
                slow={channel.id: Reading(600.0) for channel in settings.slow_channel},
            )
        )
    return found


def messages(unit: MovingUnit, sent: Iterable[SampleBlock]) -> list[Message]:
    return [(n + 1, encoded_block(block, unit.identity, T0)) for n, block in enumerate(sent)]


def windows(unit: MovingUnit) -> list[tuple[int, int]]:
    with sqlite3.connect(unit.database) as database:
        found = database.execute("SELECT epoch, first_index FROM assessment ORDER BY time_ns")
        return found.fetchall()


async def test_samples_of_a_device_that_counts_anew_without_telling_are_analysed(
    moving_unit: MakeUnit, rng: np.random.Generator
) -> None:
    whole, moved = moving_unit("whole"), moving_unit("moved")
    seconds = 10**6 / whole.plant.unit[0].sampling_hz + 100.0
    sent = messages(whole, blocks(whole, 10**6, 20) + blocks(whole, 0, 30, seconds))
    await whole.live(sent, None, rng)
    found = windows(whole)
    assert {first >= 10**6 for epoch, first in found if epoch == EPOCH} == {True}
    assert {first < 30 * N_SAMPLES for epoch, first in found if epoch >= ANEW} == {True}
    for _ in range(6):
        await moved.live(sent, 18, rng)
    await moved.live(sent, None, rng)
    assert found_in(moved.database) == found_in(whole.database)


async def test_blocks_that_come_again_late_with_their_old_time_are_dropped(
    moving_unit: MakeUnit, rng: np.random.Generator
) -> None:
    clean, late = moving_unit("clean"), moving_unit("late")
    once = blocks(clean, 10**6, 30)
    await clean.live(messages(clean, once), None, rng)
    torn = replace(once[3], rejected=(Rejection("torn", 7),))
    await late.live(messages(late, [*once[:20], *once[:10], torn, *once[20:]]), None, rng)
    assert found_in(late.database)["assessment"] == found_in(clean.database)["assessment"]
    assert found_in(late.database)["gap"] == found_in(clean.database)["gap"]


async def test_blocks_that_no_device_can_have_given_are_refused_and_nothing_dies_of_them(
    moving_unit: MakeUnit, rng: np.random.Generator
) -> None:
    clean, spoilt = moving_unit("clean"), moving_unit("spoilt")
    once = blocks(clean, 10**6, 30)
    await clean.live(messages(clean, once), None, rng)
    one = once[10]
    n_channels = one.samples.shape[0]
    wrong = [
        replace(one, samples=one.samples[:, :0]),
        replace(one, samples=np.full_like(one.samples, np.nan)),
        replace(one, samples=one.samples[1:], channel_quality=(GOOD,) * (n_channels - 1)),
        replace(one, rate_hz=2 * one.rate_hz),
        replace(one, rejected=(Rejection("torn", -5),)),
        replace(one, slow={"speed": Reading(float("inf"))}),
        replace(one, first_index=2**60),
        replace(one, start_ns=2**63 - 1),
    ]
    refused = await spoilt.live(messages(spoilt, [*once[:10], *wrong, *once[10:]]), None, rng)
    assert refused == Counter({"impossible": 4, "misfit": 2, "not_understood": 2})
    assert found_in(spoilt.database)["assessment"] == found_in(clean.database)["assessment"]


async def test_a_block_that_says_nothing_of_a_slow_channel_is_analysed_without_it(
    moving_unit: MakeUnit, rng: np.random.Generator
) -> None:
    unit = moving_unit("unit")
    sent = blocks(unit, 0, 30)
    sent = [*sent[:15], *(replace(block, slow={}) for block in sent[15:])]
    assert not await unit.live(messages(unit, sent), None, rng)
    assert windows(unit)
