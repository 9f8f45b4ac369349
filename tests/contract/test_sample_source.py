"""What every sample source promises; see `acquisition.source.SampleSource`."""

import asyncio
import itertools
from collections.abc import AsyncIterator

import numpy as np
import pytest

from acquisition.errors import LinkError
from core.samples.blocks import SampleBlock


async def blocks_up_to(blocks: AsyncIterator[SampleBlock], stop_index: int) -> list[SampleBlock]:
    taken = [await anext(blocks)]
    while taken[-1].stop_index < stop_index:
        taken.append(await anext(blocks))
    return taken


def assert_samples_are_their_own_numbers(block: SampleBlock) -> None:
    index = np.arange(block.first_index, block.stop_index)
    np.testing.assert_array_equal(block.samples[0], index % 2**15)


async def test_no_sample_is_lost_repeated_or_out_of_order_and_time_advances_with_the_index(rig):
    async with rig.source.connect() as stream:
        rig.run(rig.step_samples)
        blocks = [await anext(stream)]
        for _ in range(5):
            rig.run(4 * rig.step_samples)
            blocks += await blocks_up_to(stream, blocks[-1].stop_index + 4 * rig.step_samples)
    for before, after in itertools.pairwise(blocks):
        assert after.first_index == before.stop_index
        assert after.epoch == before.epoch
        assert after.rejected == ()
    for block in blocks:
        assert_samples_are_their_own_numbers(block)
        elapsed_ns = block.start_ns - blocks[0].start_ns
        expected_ns = (block.first_index - blocks[0].first_index) / block.rate_hz * 1e9
        assert abs(elapsed_ns - expected_ns) <= 1000
        assert (block.unit, block.rate_hz) == ("U1", 600.0)
        assert block.samples.dtype == np.float32
        assert len(block.channel_quality) == len(block.samples) == 2
        assert (block.slow["slow0"].value, block.slow["slow1"].value) == (45.0, None)


async def test_what_passed_while_nobody_was_connected_is_an_exact_jump_of_the_index(rig):
    async with rig.source.connect() as stream:
        rig.run(rig.step_samples)
        before = await anext(stream)
    rig.run(200 * rig.step_samples)
    async with rig.source.connect() as stream:
        rig.run(rig.step_samples)
        after = await anext(stream)
    assert after.epoch == before.epoch
    assert after.first_index > before.stop_index
    assert (after.first_index - before.stop_index) % rig.step_samples == 0
    assert_samples_are_their_own_numbers(after)


def gaps_between(blocks: list[SampleBlock]) -> dict[int, int]:
    """First sample and length of each gap."""
    for block in blocks:
        assert_samples_are_their_own_numbers(block)
        assert block.epoch == blocks[0].epoch
        assert block.rejected == ()
    return {
        before.stop_index: after.first_index - before.stop_index
        for before, after in itertools.pairwise(blocks)
        if after.first_index != before.stop_index
    }


async def test_a_loss_in_the_middle_of_a_stream_is_an_exact_gap(lossy_rig):
    rig = lossy_rig
    async with rig.source.connect() as stream:
        rig.run(rig.step_samples)
        blocks = [await anext(stream)]
        for first, n_lost in rig.losses.items():
            while blocks[-1].stop_index < first:
                rig.run(rig.step_samples)
                blocks += await blocks_up_to(stream, blocks[-1].stop_index + rig.step_samples)
            rig.run(n_lost + 4 * rig.step_samples)
            blocks += await blocks_up_to(stream, first + n_lost + 2 * rig.step_samples)
    assert gaps_between(blocks) == rig.losses


async def test_polls_that_could_not_be_made_in_time_are_an_exact_gap(polled_rig):
    rig, missed = polled_rig, {}
    async with rig.source.connect() as stream:
        blocks = [await anext(stream)]
        for n_lost in rig.losses.values():
            blocks += await blocks_up_to(stream, blocks[-1].stop_index + 20)
            missed[blocks[-1].stop_index] = n_lost
            rig.stall(n_lost + 1)
            blocks += await blocks_up_to(stream, blocks[-1].stop_index + n_lost + 20)
    assert gaps_between(blocks) == missed


async def test_a_stream_that_was_left_has_ended_and_leaves_no_task_behind(rig):
    before = asyncio.all_tasks()
    async with rig.source.connect() as stream:
        rig.run(rig.step_samples)
        await anext(stream)
    own = {task for task in asyncio.all_tasks() - before if "server" not in repr(task)}
    assert own == set()
    await stream.aclose()
    with pytest.raises(StopAsyncIteration):
        await anext(stream)


async def test_a_source_left_before_its_first_block_can_be_connected_again(rig):
    async with rig.source.connect():
        pass
    async with rig.source.connect() as stream:
        rig.run(rig.step_samples)
        assert_samples_are_their_own_numbers(await anext(stream))


async def test_a_pulled_plug_is_a_lost_link_and_a_source_goes_on_after_it_is_back(wired_rig):
    async with wired_rig.source.connect() as stream:
        first = await anext(stream)
    await wired_rig.pull()
    with pytest.raises(LinkError, match=wired_rig.absence):
        async with wired_rig.source.connect():
            pass
    wired_rig.run(3 * wired_rig.step_samples)
    await wired_rig.plug_in()
    async with wired_rig.source.connect() as stream:
        second = await anext(stream)
        await wired_rig.pull()
        with pytest.raises(LinkError):
            await blocks_up_to(stream, second.stop_index + 4 * wired_rig.step_samples)
    # what is polled and not kept is lost, but for the poll that is due on return
    n_lost = 0 if getattr(wired_rig, "keeps", True) else 3 * wired_rig.step_samples - 1
    assert second.first_index == first.stop_index + n_lost
    assert_samples_are_their_own_numbers(second)
