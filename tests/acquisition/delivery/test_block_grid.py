"""The same samples make the same blocks, whatever the wire cut them into."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.delivery.arrival import Arrival
from acquisition.delivery.blocks import BlockAssembler, BlockGrid
from acquisition.delivery.calibration import RawBlock
from core.samples.blocks import Rejection

LENGTH = 50
N_SAMPLES = 1000
START_NS = 1_767_225_600_000_000_123


def piece(start: int, stop: int, **other) -> RawBlock:
    """Samples that are their own numbers; slow value and verdict change every hundred."""
    return RawBlock(
        epoch=other.pop("epoch", 1),
        first_index=start,
        start_ns=START_NS + round(start * 1e9 / 600.0),
        rate_hz=600.0,
        counts=np.arange(start, stop, dtype=np.int16)[np.newaxis],
        ok=(start // 100 != 3,),
        slow=(float(start // 100),),
        **other,
    )


def blocks_of(cuts: list[int]) -> list[RawBlock]:
    """Blocks of the samples between the first cut and the last, cut there and at each hundred."""
    grid = BlockGrid(LENGTH)
    edges = sorted({*cuts, *range(100 * (cuts[0] // 100 + 1), cuts[-1], 100)})
    made = [b for start, stop in itertools.pairwise(edges) for b in grid.put(piece(start, stop))]
    return made + grid.flush()


def facts(block: RawBlock) -> tuple[object, ...]:
    return (block.epoch, block.first_index, block.counts.tobytes(), block.ok, block.slow)


@given(st.sets(st.integers(1, N_SAMPLES - 1), max_size=40), st.integers(0, 120))
def test_blocks_do_not_depend_on_the_cuts_of_the_wire(cuts: set[int], start: int) -> None:
    edges = [start, *sorted(c for c in cuts if c > start), N_SAMPLES]
    made, whole = blocks_of(edges), blocks_of([start, N_SAMPLES])
    assert [facts(block) for block in made] == [facts(block) for block in whole]
    assert np.array_equal(np.concatenate([b.counts[0] for b in made]), np.arange(start, N_SAMPLES))
    # each piece rounds its own stamp, so stamps agree to a nanosecond before they are floored
    for block, same in zip(made, whole, strict=True):
        assert abs(block.start_ns - same.start_ns) <= 1000


def test_blocks_begin_at_multiples_of_their_length() -> None:
    made = blocks_of([30, 333])
    assert [b.first_index for b in made] == [30, 50, 100, 150, 200, 250, 300]
    assert [b.counts.shape[1] for b in made] == [20, 50, 50, 50, 50, 50, 33]
    assert all(block.start_ns % 1000 == 0 for block in made)  # as a wire in microseconds carries


def test_a_gap_or_a_restart_ends_the_block_before_it_and_keeps_what_was_rejected() -> None:
    grid = BlockGrid(LENGTH)
    assert grid.put(piece(0, 30)) == []
    refused = (Rejection("torn_slot", 10),)
    done = grid.put(piece(45, 100, rejected=refused))
    assert [(b.first_index, b.counts.shape[1], b.rejected) for b in done] == [
        (0, 30, ()),
        (45, 5, refused),
        (50, 50, ()),
    ]
    grid.put(piece(100, 130))
    done = grid.put(piece(130, 150, epoch=2))
    assert [(b.epoch, b.first_index, b.counts.shape[1]) for b in done] == [
        (1, 100, 30),
        (2, 130, 20),
    ]


def test_one_part_that_is_not_ok_makes_the_block_not_ok() -> None:
    grid = BlockGrid(LENGTH)
    grid.put(piece(250, 299))
    grid.put(piece(299, 300))
    grid.put(piece(300, 301))
    [block] = grid.flush()
    assert block.ok == (False,)
    assert block.first_index == 300


ARRIVED = Arrival(1_767_225_600_000_000_000, 5000.0)


@pytest.fixture
def delivery(counts_calibration) -> BlockAssembler:
    return BlockAssembler(counts_calibration(2))


def test_what_has_waited_in_the_device_is_older_than_the_newest(delivery, counting_feed):
    feed = counting_feed()
    blocks = delivery.take_together([feed.advance(60) for _ in range(3)], ARRIVED, 0.25)
    assert [block.sampled_s for block in blocks] == pytest.approx([4999.55, 4999.65, 4999.75])


def test_what_comes_from_no_device_has_no_age(delivery, counting_feed):
    [block] = delivery.take(counting_feed().advance(60))
    assert block.sampled_s is None
