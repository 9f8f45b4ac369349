"""The same samples make the same blocks, whatever the wire cut them into, judged by channel."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rigs.blocks import cell_block

from acquisition.delivery.arrival import Arrival
from acquisition.delivery.blocks import BlockAssembler, BlockJoiner
from core.quality import GOOD, Quality, Reason, bad, uncertain
from core.samples.blocks import Rejection, SampleBlock, joined
from core.samples.calibration import ChannelCalibration, SlowCalibration, UnitCalibration

LENGTH = 50
N_SAMPLES = 1000
START_NS = 1_767_225_600_000_000_123
CALIBRATION = UnitCalibration(
    "U1",
    600.0,
    (ChannelCalibration(32768.0, 1.0, -32768.0, 32768.0),),
    (SlowCalibration("slow", 0.0, 100.0),),
)


def piece(start: int, stop: int, **other) -> SampleBlock:
    """Samples that are their own numbers; slow value and verdict change every hundred."""
    return cell_block(
        epoch=other.pop("epoch", 1),
        first_index=start,
        start_ns=START_NS + round(start * 1e9 / 600.0),
        rate_hz=600.0,
        counts=np.arange(start, stop, dtype=np.int16)[np.newaxis],
        ok=(start // 100 != 3,),
        slow=(float(start // 100),),
        calibration=CALIBRATION,
        **other,
    )


def blocks_of(cuts: list[int]) -> list[SampleBlock]:
    """Blocks of the samples between the first cut and the last, cut there and at each hundred."""
    grid = BlockJoiner(LENGTH)
    edges = sorted({*cuts, *range(100 * (cuts[0] // 100 + 1), cuts[-1], 100)})
    made = [b for start, stop in itertools.pairwise(edges) for b in grid.put([piece(start, stop)])]
    return made + grid.flush()


def facts(block: SampleBlock) -> tuple[object, ...]:
    cells = [a.tolist() for a in (block.side.starts, block.side.ok, block.side.slow)]
    return (block.epoch, block.first_index, block.counts.tobytes(), *cells)


@given(st.sets(st.integers(1, N_SAMPLES - 1), max_size=40), st.integers(0, 120))
def test_blocks_do_not_depend_on_the_cuts_of_the_wire(cuts, start):
    edges = [start, *sorted(c for c in cuts if c > start), N_SAMPLES]
    made, whole = joined(blocks_of(edges)), joined(blocks_of([start, N_SAMPLES]))
    assert facts(made) == facts(whole)
    assert (made.first_index + made.side.starts[1:]).tolist() == cells_within(made)
    assert np.array_equal(made.counts[0], np.arange(start, N_SAMPLES))
    # each piece rounds its own stamp, so stamps agree to a nanosecond before they are floored
    assert np.abs(made.side.start_ns - whole.side.start_ns).max() <= 1000


def cells_within(block: SampleBlock) -> list[int]:
    return [n for n in range(block.first_index + 1, block.stop_index) if n % LENGTH == 0]


def test_cells_begin_at_multiples_of_their_length():
    made = [cell for block in blocks_of([30, 333]) for cell in block.cells()]
    assert [b.first_index for b in made] == [30, 50, 100, 150, 200, 250, 300]
    assert [b.counts.shape[1] for b in made] == [20, 50, 50, 50, 50, 50, 33]
    assert all(cell.start_ns % 1000 == 0 for cell in made)  # as a wire in microseconds carries


def test_a_gap_or_a_restart_ends_the_block_before_it_and_keeps_what_was_rejected():
    grid = BlockJoiner(LENGTH)
    assert grid.put([piece(0, 30)]) == []
    refused = (Rejection("torn_slot", 10),)
    done = grid.put([piece(45, 100, rejected=refused)])
    assert [(b.first_index, b.side.starts.tolist(), b.n_samples, b.rejected) for b in done] == [
        (0, [0], 30, ()),
        (45, [0, 5], 55, refused),
    ]
    grid.put([piece(100, 130)])
    done = grid.put([piece(130, 150, epoch=2)])
    assert [(b.epoch, b.first_index, b.counts.shape[1]) for b in done] == [
        (1, 100, 30),
        (2, 130, 20),
    ]


def test_one_part_that_is_not_ok_makes_the_block_not_ok():
    grid = BlockJoiner(LENGTH)
    grid.put([piece(250, 299)])
    grid.put([piece(299, 300)])
    grid.put([piece(300, 301)])
    [block] = grid.flush()
    assert block.side.ok.tolist() == [[False]]
    assert block.first_index == 300


ARRIVED = Arrival(1_767_225_600_000_000_000, 5000.0)


@pytest.fixture
def delivery(counts_calibration) -> BlockAssembler:
    return BlockAssembler(counts_calibration(2))


def test_what_has_waited_in_the_device_is_older_than_the_newest(delivery, counting_feed):
    feed = counting_feed()
    first, second, third = (feed.advance(60) for _ in range(3))
    gap = replace(third, first_index=190)
    blocks = delivery.take([first, second, gap], ARRIVED, 0.25)
    assert [(b.first_index, b.n_samples) for b in blocks] == [(0, 120), (190, 60)]
    assert [block.sampled_s for block in blocks] == pytest.approx([4999.65, 4999.75])


def held(calibration) -> BlockAssembler:
    return BlockAssembler(calibration, min_block_s=0.25)


def shape_of(blocks: list[SampleBlock]) -> list[tuple[int, int]]:
    return [(block.first_index, block.n_samples) for block in blocks]


def test_cells_are_held_until_they_last_a_quarter_of_a_second(counting_feed, counts_calibration):
    feed, delivery = counting_feed(), held(counts_calibration(2))
    arrivals = [Arrival(ARRIVED.host_ns, 5000.0 + 0.05 * n) for n in range(20)]
    taken = [delivery.take([feed.advance(30)], arrived) for arrived in arrivals]
    assert [shape_of(blocks) for blocks in taken if blocks] == [
        [(0, 150)],
        [(150, 150)],
        [(300, 150)],
        [(450, 150)],
    ]
    assert [block.side.starts.tolist() for [block] in filter(None, taken)] == [[0, 50, 100]] * 4
    assert [block.sampled_s for [block] in filter(None, taken)] == [
        5000.2,
        5000.45,
        5000.7,
        5000.95,
    ]


def test_a_pause_releases_whole_cells_and_keeps_the_rest(counting_feed, counts_calibration):
    feed, delivery = counting_feed(), held(counts_calibration(2))
    assert delivery.release() == []
    assert delivery.take([feed.advance(40)], ARRIVED) == []
    assert (delivery.n_whole, delivery.release()) == (0, [])
    assert delivery.take([feed.advance(70)], ARRIVED) == []
    assert delivery.n_whole == 100
    [block] = delivery.release()
    assert (block.first_index, block.n_samples, block.clock is None) == (0, 100, False)
    assert delivery.release() == []
    assert shape_of(delivery.take([feed.advance(140)], ARRIVED)) == [(100, 150)]


def test_a_gap_ends_what_is_held(counting_feed, counts_calibration):
    feed, delivery = counting_feed(), held(counts_calibration(2))
    assert delivery.take([feed.advance(110)], ARRIVED) == []
    feed.advance(30)
    assert shape_of(delivery.take([feed.advance(60)], ARRIVED)) == [(0, 110)]
    assert shape_of(delivery.release()) == [(140, 60)]


def test_what_comes_from_no_device_has_no_age(delivery, counting_feed):
    [block] = delivery.take([counting_feed().advance(160)])
    assert block.sampled_s is None


PROBE = ChannelCalibration(10.0, -250.0, -9.0, 9.0)
"""10 V are 2500 µm; on average from -9 to 9 V, which is 29,491 counts or 2250 µm."""


def judged(samples: np.ndarray, ok: bool = True) -> Quality:
    calibration = UnitCalibration("U1", 600.0, (PROBE,), ())
    block = cell_block(1, 0, 0, 600.0, samples[np.newaxis], (ok,), (), calibration=calibration)
    return block.channel_quality[0]


@pytest.mark.parametrize(
    ("dtype", "samples", "expected"),
    [
        (np.int16, [0, 32766], GOOD),
        (np.int16, [0, 32767], bad(Reason.CLIPPED)),
        (np.int16, [0, -32767], GOOD),
        (np.int16, [0, -32768], bad(Reason.CLIPPED)),
        (np.int16, [29_491, 29_491], GOOD),
        (np.int16, [29_492, 29_492], uncertain(Reason.SENSOR_FAILURE)),
        (np.int16, [-29_492, -29_492], uncertain(Reason.SENSOR_FAILURE)),
        (np.int16, [32_767, 32_767], bad(Reason.SENSOR_FAILURE)),
        (np.float32, [0.0, 2499.0], GOOD),
        (np.float32, [0.0, 2500.0], bad(Reason.CLIPPED)),
        (np.float32, [0.0, -2500.0], bad(Reason.CLIPPED)),
        (np.float32, [2249.0, 2249.0], GOOD),
        (np.float32, [2251.0, 2251.0], uncertain(Reason.SENSOR_FAILURE)),
        (np.float32, [-2251.0, -2251.0], uncertain(Reason.SENSOR_FAILURE)),
        (np.float32, [2500.0, 2500.0], bad(Reason.SENSOR_FAILURE)),
        (np.float32, [0.0, math.inf], bad(Reason.NOT_FINITE)),
        (np.float32, [0.0, math.nan], bad(Reason.NOT_FINITE)),
    ],
)
def test_a_channel_is_judged_by_its_samples(dtype, samples, expected):
    """A block is shorter than a turn: that its mean is outside the OK limits is only a doubt."""
    assert judged(np.array(samples, dtype)) == expected


@pytest.mark.parametrize("dtype", [np.int16, np.float32])
def test_a_channel_that_its_device_calls_bad_has_failed(dtype):
    assert judged(np.zeros(5, dtype), ok=False) == bad(Reason.SENSOR_FAILURE)
