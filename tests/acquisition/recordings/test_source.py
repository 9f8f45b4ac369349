"""A recording as a source and as the feed of a simulated DAQ."""

import inspect
import itertools
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from acquisition.delivery.blocks import BlockAssembler
from acquisition.errors import ConfigError
from acquisition.recordings.reader import open_recording
from acquisition.recordings.source import RecordingSource, select
from acquisition.simulated.devices.recorded import RecordedFeed
from acquisition.simulated.feed import FeedEndedError
from core.machine.channel import Channel, Measurand
from core.machine.unit import Unit
from core.samples.blocks import Rejection, SampleBlock, joined
from core.samples.calibration import UnitCalibration

FOREIGN = [
    kind
    for _, kind in inspect.getmembers(pa.lib, inspect.isclass)
    if issubclass(kind, pa.ArrowException | OSError)
] + [OSError, PermissionError, TimeoutError]


def machine(*channels: str, measurand: Measurand = Measurand.GAP_UM, **changes: object) -> Unit:
    made = Unit("U1", 92.3, 600.0, tuple(Channel(id_, measurand) for id_ in channels), ())
    return replace(made, **changes)


@pytest.mark.long
async def test_blocks_are_those_that_were_calibrated_live_also_when_left_and_taken_up_again(
    record, numbered, stepped_clock
):
    raws = [numbered(50 * n, 50) for n in range(14)]
    source = RecordingSource(open_recording(record(raws)), stepped_clock)
    async with source.connect() as blocks:
        found = [await anext(blocks), await anext(blocks)]
    assert stepped_clock.monotonic_s() == 0.0
    stepped_clock.step(1e6)
    async with source.connect() as blocks:
        found += [block async for block in blocks]
    assert stepped_clock.monotonic_s() == 1e6
    assert [block.n_samples for block in found] == [150, 150, 150, 150, 100]
    for n, block in enumerate(found):
        live = joined(raws[3 * n : 3 * n + 3])
        assert block.samples.tobytes() == live.samples.tobytes()
        assert block == live
    async with source.connect() as blocks:
        assert [block async for block in blocks] == []


@pytest.mark.parametrize("speed", [1.0, 50.0])
async def test_it_takes_the_time_it_took_gaps_included_and_restarts_not(
    record, numbered, stepped_clock, speed
):
    raws = [numbered(0, 50), numbered(6050, 50), numbered(100, 50, epoch=2)]
    source = RecordingSource(open_recording(record(raws)), stepped_clock, speed=speed)
    async with source.connect() as blocks:
        arrived_s = [stepped_clock.monotonic_s() async for _ in blocks]
    assert np.multiply(arrived_s, speed) == pytest.approx([50 / 600, 6100 / 600, 6150 / 600])


def test_time_cannot_stand_still_or_run_back(record, numbered, stepped_clock):
    recording = open_recording(record([numbered(0, 50)]))
    for speed in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match="speed must be above 0"):
            RecordingSource(recording, stepped_clock, speed=speed)


async def test_a_unit_finds_its_channels_by_name_wherever_they_are(record, numbered, stepped_clock):
    raw = numbered(0, 50, ok=(True, False), slow=(40.0, 50.0))
    recording = open_recording(record([raw]))
    wanted = machine("c1", "c0", id="U7")
    selection = select(recording.manifest, wanted, {"slow1": "degC"})
    async with RecordingSource(recording, stepped_clock, selection).connect() as blocks:
        block = await anext(blocks)
    assert block.unit == "U7"
    np.testing.assert_array_equal(block.samples, raw.samples[[1, 0]])
    assert block.channel_quality == raw.channel_quality[::-1]
    assert {id_: reading.value for id_, reading in block.slow.items()} == {"slow1": 50.0}


@pytest.mark.parametrize(
    ("wanted", "slow_units", "words"),
    [
        (machine("c0", rate_hz=500.0), {}, "600 Hz, but unit U1 of 500 Hz"),
        (machine("c0", "x", "y"), {}, "requires channel x, y, but the recording has c0, c1"),
        (
            machine("c0", measurand=Measurand.VELOCITY_MM_S),
            {},
            "channel c0 is recorded as gap_um, but configured as velocity_mm_s in unit U1",
        ),
        (machine("c0"), {"power": "MW"}, "slow channel power, but the recording has slow0, slow1"),
        (
            machine("c0"),
            {"slow0": "mm"},
            "slow channel slow0 is recorded as degC, but configured as mm in unit U1",
        ),
    ],
    ids=["rate", "channel", "measurand", "slow channel", "slow unit"],
)
def test_a_recording_of_something_else_is_refused_naming_both(unit, wanted, slow_units, words):
    with pytest.raises(ConfigError, match=words):
        select(unit, wanted, slow_units)


async def test_a_recording_that_vanishes_is_an_error_of_its_own(record, numbered, stepped_clock):
    recording = open_recording(record([numbered(0, 50)]))
    (recording.folder / "samples.parquet").unlink()
    async with RecordingSource(recording, stepped_clock).connect() as blocks:
        with pytest.raises(ConfigError, match=r"samples\.parquet: No such file"):
            await anext(blocks)


@pytest.mark.parametrize("call", ["__init__", "read_row_group"])
@pytest.mark.parametrize("kind", FOREIGN, ids=lambda kind: kind.__name__)
@pytest.mark.usefixtures("reads_here")
async def test_no_exception_of_pyarrow_or_the_disk_leaves_under_its_own_name(
    record, numbered, stepped_clock, monkeypatch, kind, call
):
    recording = open_recording(record([numbered(50 * n, 50) for n in range(5)]))

    def fails(*_: object, **__: object) -> None:
        raise kind("as seen in the field")

    monkeypatch.setattr(pq.ParquetFile, call, fails)
    async with RecordingSource(recording, stepped_clock).connect() as blocks:
        with pytest.raises(
            ConfigError, match=r"\.parquet: .*as seen in the field|more than 256 MiB"
        ):
            await anext(blocks)


def all_pieces(feed: RecordedFeed, lengths: Iterable[int]) -> list[SampleBlock]:
    pieces = []
    for length in lengths:
        try:
            pieces.append(feed.advance(length))
        except FeedEndedError:
            return pieces
    raise AssertionError


@pytest.mark.parametrize("length", [1, 7, 20, 50, 60, 1000])
def test_pieces_of_any_length_bring_every_sample_once_at_its_index(record, numbered, length):
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
def test_what_a_daq_makes_of_it_is_the_recording_to_the_last_bit(record, numbered, length):
    blocks = [
        numbered(0, 50, slow=(40.0, 1.0)),
        numbered(50, 50, slow=(41.0, 2.0), ok=(True, False)),
        numbered(150, 50, slow=(42.0, 3.0)),
    ]
    recording = open_recording(record(blocks))
    pieces = all_pieces(RecordedFeed(recording), itertools.repeat(length))
    again = through_delivery(pieces, recording.manifest.calibration)
    assert again == through_delivery(blocks, recording.manifest.calibration)


def through_delivery(raws: list[SampleBlock], calibration: UnitCalibration) -> list[str]:
    delivery = BlockAssembler(calibration)
    blocks = [block for raw in raws for block in delivery.take([raw])] + delivery.flush()
    return [f"{block!r} {block.samples.tobytes().hex()}" for block in blocks]


def test_the_length_of_pieces_may_change_at_any_time(record, numbered):
    blocks = [numbered(50 * n, 50) for n in range(20)]
    feed = RecordedFeed(open_recording(record(blocks)))
    with pytest.raises(ValueError, match="n_samples must be at least 1, got 0"):
        feed.advance(0)
    pieces = all_pieces(feed, itertools.cycle([7, 200, 1, 64]))
    index = [n for p in pieces for n in range(p.first_index, p.stop_index)]
    assert index == list(range(1000))
    with pytest.raises(FeedEndedError):
        feed.advance(5)


def test_only_the_channels_of_the_unit_are_given(record, numbered):
    recording = open_recording(record([numbered(0, 50, ok=(True, False))]))
    unit = Unit("U1", 92.3, 600.0, (Channel("c1", Measurand.GAP_UM),), ())
    piece = RecordedFeed(recording, select(recording.manifest, unit, {})).advance(50)
    np.testing.assert_array_equal(piece.counts, [np.arange(1, 51)])
    assert (piece.side.ok.tolist(), piece.side.slow.size) == ([[False]], 0)
