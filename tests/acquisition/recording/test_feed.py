"""A recording behind a simulated DAQ gives what the converter once gave."""

import itertools
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest

from acquisition.calibration import UnitCalibration
from acquisition.delivery import Delivery
from acquisition.raw import FeedEndedError, RawBlock
from acquisition.recording.feed import RecordedFeed
from acquisition.recording.reader import open_recording
from acquisition.recording.selection import select
from core.blocks import Rejection
from core.machine import Channel, Measurand, Unit

Record = Callable[[Iterable[RawBlock]], Path]
Numbered = Callable[..., RawBlock]


def all_pieces(feed: RecordedFeed, lengths: Iterable[int]) -> list[RawBlock]:
    pieces = []
    for length in lengths:
        try:
            pieces.append(feed.advance(length))
        except FeedEndedError:
            return pieces
    raise AssertionError


@pytest.mark.parametrize("length", [1, 7, 20, 50, 60, 1000])
def test_pieces_of_any_length_bring_every_sample_once_at_its_index(
    record: Record, numbered: Numbered, length: int
) -> None:
    # what was rejected is as missing as a gap; then directly on it
    stretches = [(0, 200, ()), (263, 400, (Rejection("torn", 50),)), (400, 450, ())]
    blocks = [numbered(a, b - a, rejected=rejected) for a, b, rejected in stretches]
    blocks.append(numbered(30, 100, epoch=2))
    feed = RecordedFeed(open_recording(record(blocks)))
    pieces = all_pieces(feed, itertools.repeat(length))
    found = [(p.epoch, n) for p in pieces for n in range(p.first_index, p.stop_index)]
    assert found == [(1, n) for a, b, _ in stretches for n in range(a, b)] + [
        (2, n) for n in range(30, 130)
    ]
    for piece in pieces:
        assert piece.first_index // length == (piece.stop_index - 1) // length
        np.testing.assert_array_equal(
            piece.counts[0], np.arange(piece.first_index, piece.stop_index)
        )


@pytest.mark.parametrize("length", [1, 10, 25, 50])
def test_what_a_daq_makes_of_it_is_the_recording_to_the_last_bit(
    record: Record, numbered: Numbered, length: int
) -> None:
    blocks = [
        numbered(0, 50, slow=(40.0, 1.0)),
        numbered(50, 50, slow=(41.0, 2.0), ok=(True, False)),
        numbered(150, 50, slow=(42.0, 3.0)),
    ]
    recording = open_recording(record(blocks))
    pieces = all_pieces(RecordedFeed(recording), itertools.repeat(length))
    again = through_delivery(pieces, recording.manifest.calibration)
    assert again == through_delivery(blocks, recording.manifest.calibration)


def through_delivery(raws: list[RawBlock], calibration: UnitCalibration) -> list[str]:
    delivery = Delivery(calibration)
    blocks = [block for raw in raws for block in delivery.take(raw)] + delivery.flush()
    return [f"{block!r} {block.samples.tobytes().hex()}" for block in blocks]


def test_the_length_of_pieces_may_change_at_any_time(record: Record, numbered: Numbered) -> None:
    blocks = [numbered(50 * n, 50) for n in range(20)]
    feed = RecordedFeed(open_recording(record(blocks)))
    with pytest.raises(ValueError, match="0 samples asked for"):
        feed.advance(0)
    pieces = all_pieces(feed, itertools.cycle([7, 200, 1, 64]))
    index = [n for p in pieces for n in range(p.first_index, p.stop_index)]
    assert index == list(range(1000))
    with pytest.raises(FeedEndedError):
        feed.advance(5)


def test_only_the_channels_of_the_unit_are_given(record: Record, numbered: Numbered) -> None:
    recording = open_recording(record([numbered(0, 50, ok=(True, False))]))
    unit = Unit("U1", 92.3, 600.0, (Channel("c1", Measurand.GAP_UM),), ())
    piece = RecordedFeed(recording, select(recording.manifest, unit, {})).advance(50)
    np.testing.assert_array_equal(piece.counts, [np.arange(1, 51)])
    assert (piece.ok, piece.slow) == ((False,), ())
