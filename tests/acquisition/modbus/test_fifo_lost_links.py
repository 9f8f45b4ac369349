"""A link that is lost while a queue is emptied: what was read is gone there, and is kept here."""

import pytest
from rigs.queues import INTERLEAVED, PER_CHANNEL, STEP, UNCOUNTED, assert_right, gaps, up_to

from acquisition.errors import LinkError
from core.blocks import SampleBlock

BOTH_LAYOUTS = pytest.mark.parametrize("layout", [INTERLEAVED, PER_CHANNEL])
N_READ = 7
"""Readings of each queue before the link is lost."""


def lose_the_link_after(p, n_answers: int) -> None:
    """Let the answer after so many be lost on its way."""
    answer, n_asked = p.device.read_fifo, 0

    def answer_or_cut(address: int) -> bytes | None:
        nonlocal n_asked
        n_asked += 1
        if n_asked == n_answers + 1:
            p.server.cut()
        return answer(address)

    p.device.read_fifo = answer_or_cut


async def until_lost(stream, said: str | None = None) -> list[SampleBlock]:
    blocks = []

    async def take() -> None:
        async for block in stream:
            blocks.append(block)

    with pytest.raises(LinkError, match=said):
        await take()
    return blocks


@BOTH_LAYOUTS
async def test_a_lost_link_loses_no_more_than_the_answer_that_was_on_its_way(
    queues, layout
) -> None:
    async with queues(layout) as p:
        async with p.source.connect() as stream:
            first = await up_to(stream, STEP)
            p.run(10)
            lose_the_link_after(p, N_READ * len(layout.addresses))
            before = await until_lost(stream)
        async with p.source.connect() as stream:
            after = await up_to(stream, 10 * STEP)

    blocks = [*first, *before, *after]
    assert gaps(blocks) == [(STEP + N_READ * layout.most_samples, layout.most_samples)]
    assert_right(blocks)


async def test_samples_that_are_not_counted_are_not_kept_where_some_may_be_missing(queues) -> None:
    async with queues(UNCOUNTED) as p, p.source.connect() as stream:
        p.run(10)
        lose_the_link_after(p, N_READ)
        assert await until_lost(stream) == []


async def test_what_was_read_over_too_slow_a_link_is_kept_too(queues) -> None:
    async with queues(depth_samples=100_000) as p, p.source.connect() as stream:
        first = await up_to(stream, STEP)
        answer = p.device.read_fifo

        def slowly(address: int) -> bytes | None:
            p.run(1)
            return answer(address)

        p.device.read_fifo = slowly
        before = await until_lost(stream, "too slow for 600 samples per second")
    assert len(before) > 1
    assert gaps([*first, *before]) == []
    assert_right([*first, *before])
