"""What was written comes back: every count, every bit of every number, every gap."""

import resource
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rigs.blocks import cell_block

from acquisition.errors import ConfigError
from acquisition.recordings import child, tables, writer
from acquisition.recordings.manifest import RecordedChannel, RecordedSlowChannel, RecordedUnit
from acquisition.recordings.reader import Recording, open_recording
from acquisition.recordings.writer import RecordingWriter
from core.machine.channel import Measurand
from core.samples.blocks import Rejection, SampleBlock, joined

WORDS = st.text(st.characters(codec="utf-8"), min_size=1, max_size=64)
REJECTIONS = st.builds(Rejection, WORDS, st.integers(1, 999))


def bits(block: SampleBlock) -> tuple[object, ...]:
    """Everything about a block, NaN and signed zero included, in a form that can be compared."""
    side = block.side
    arrays = (block.counts, side.starts, side.start_ns, side.ok, side.slow)
    values = [(array.dtype.str, array.shape, array.tobytes()) for array in arrays]
    return (block.epoch, block.first_index, block.rejected, values)


def cells(recording: Recording, *blocks: int) -> list[tuple[object, ...]]:
    return [bits(cell) for block in recording.blocks(*blocks) for cell in block.cells()]


@st.composite
def recordings(draw: st.DrawFn) -> tuple[RecordedUnit, list[SampleBlock]]:
    """Any unit and any stream of blocks a device may deliver."""
    n_channels, n_slow = draw(st.integers(1, 32)), draw(st.integers(0, 4))
    number = st.floats(-1e6, 1e6).filter(bool)
    sample_type = draw(st.sampled_from(["int16", "float32"]))
    unit = RecordedUnit(
        unit="U1",
        rate_hz=draw(st.sampled_from([600.0, 1000 / 3])),
        channels=tuple(
            RecordedChannel(
                id=f"c{n}",
                measurand=draw(st.sampled_from(Measurand)),
                full_scale_v=draw(st.floats(1e-3, 100.0)),
                unit_per_v=draw(number),
                ok_min_v=-100.0,
                ok_max_v=draw(number),
            )
            for n in range(n_channels)
        ),
        slow_channels=tuple(
            RecordedSlowChannel(id=f"s{n}", unit="degC", minimum=-10.0, maximum=draw(number))
            for n in range(n_slow)
        ),
        sample_type=sample_type,
        block_samples=draw(st.integers(1, 1000)),
    )
    blocks, epoch, index = [], draw(st.integers(0, 2**32)), draw(st.integers(0, 2**50))
    for _ in range(draw(st.integers(1, 6))):
        if draw(st.booleans()):
            epoch, index = epoch + draw(st.integers(1, 2**32)), 0
        rejected = draw(st.lists(REJECTIONS, max_size=3))
        index += sum(r.n_samples for r in rejected) + draw(st.sampled_from([0, 0, 1, 10**6]))
        n_samples = draw(st.integers(1, 9))
        counts = draw(arrays(sample_type, (n_channels, n_samples)))
        flags = st.lists(st.booleans(), min_size=n_channels, max_size=n_channels)
        slow = st.lists(st.floats(), min_size=n_slow, max_size=n_slow)
        blocks.append(
            cell_block(
                epoch=epoch,
                first_index=index,
                start_ns=draw(st.integers(-(2**62), 2**62)),
                rate_hz=unit.rate_hz,
                counts=counts,
                ok=tuple(draw(flags)),
                slow=tuple(draw(slow)),
                rejected=tuple(rejected),
                calibration=unit.calibration,
            )
        )
        index += n_samples
    return unit, blocks


@settings(max_examples=30, deadline=None)
@given(recordings())
def test_any_stream_of_blocks_comes_back_bit_for_bit(recording):
    unit, blocks = recording
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / "recording"
        with RecordingWriter(folder, unit, "a test") as recorder:
            for block in blocks:
                recorder.write(block)
        opened = open_recording(folder)
        assert cells(opened) == list(map(bits, blocks))
        manifest = opened.manifest
        assert RecordedUnit(**{name: getattr(manifest, name) for name in dict(unit)}) == unit
        assert manifest.calibration == unit.calibration
        assert manifest.calibration.block_samples == unit.block_samples
        assert (manifest.n_blocks, manifest.n_samples) == (
            len(blocks),
            sum(block.counts.shape[1] for block in blocks),
        )


@pytest.mark.parametrize("n_each", [1, 7, 64, 200])
@pytest.mark.usefixtures("reads_here")
def test_blocks_of_any_length_come_back_across_row_groups(record, numbered, monkeypatch, n_each):
    for module in (writer, child):
        monkeypatch.setattr(module, "ROWS_PER_GROUP", 200)
        monkeypatch.setattr(module, "BLOCKS_PER_GROUP", 10)
    blocks = [numbered(n_each * n, n_each) for n in range(900 // n_each + 3)]
    opened = open_recording(record(blocks))
    assert cells(opened) == list(map(bits, blocks))
    assert cells(opened, 3) == list(map(bits, blocks[3:]))
    assert cells(opened, 2, 4) == list(map(bits, blocks[2:4]))
    with tables.parquet_file(
        opened.folder / "samples.parquet",
        tables.samples_schema(opened.manifest),
        opened.manifest.n_samples,
        200,
    ) as file:
        assert file.num_row_groups == -(-opened.manifest.n_samples // 200) > 4


def test_a_recording_being_written_is_none_yet_and_is_never_overwritten(tmp_path, unit, numbered):
    folder = tmp_path / "run"
    with RecordingWriter(folder, unit, "a test") as recorder:
        recorder.write(numbered(0, 10))
        assert [path.name for path in tmp_path.iterdir()] == ["run.incomplete"]
        with pytest.raises(ConfigError, match=r"run\.incomplete: manifest.json is missing"):
            open_recording(tmp_path / "run.incomplete")
        with pytest.raises(ConfigError, match=r"run\.incomplete: the folder exists already"):
            RecordingWriter(folder, unit, "another")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    with pytest.raises(ConfigError, match="run: folder exists already"):
        RecordingWriter(folder, unit, "another")
    assert open_recording(folder).manifest.n_samples == 10


def test_a_disk_that_is_full_in_the_end_keeps_no_half_recording(tmp_path, unit, numbered):
    limit, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    writer = RecordingWriter(tmp_path / "run", unit, "a test")
    writer.write(numbered(0, 50))
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, most))
    try:
        with pytest.raises(ConfigError, match=r"run\.incomplete: .*File too large"), writer:
            pass
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, most))
    assert list(tmp_path.iterdir()) == []


def test_a_recording_that_was_broken_off_or_is_empty_leaves_nothing(tmp_path, unit, numbered):
    broken_off = RecordingWriter(tmp_path / "a", unit, "x")
    broken_off.write(numbered(0, 10))
    with pytest.raises(ZeroDivisionError), broken_off:
        _ = 1 / 0
    empty = RecordingWriter(tmp_path / "b", unit, "x")
    with pytest.raises(ConfigError, match="nothing was recorded"):
        empty.finish()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"counts": np.zeros((2, 5), np.int32)}, "int32"),
        ({"counts": np.zeros((2, 5), np.float32)}, "must be int16, got float32"),
        ({"counts": np.zeros((2, 0), np.int16)}, "1 to 131072, got 0"),
        ({"counts": np.zeros((2, 131_073), np.int16)}, "got 131073"),
        ({"first_index": -1}, "block 1: first_index must be 0 .* got -1"),
        ({"epoch": 2**60}, "block 1: epoch must be 0 .* got 1152921504606846976"),
        ({"rejected": (Rejection("torn", 11),)}, "11 rejected, but 10 missing"),
        ({"rejected": (Rejection("x" * 65, 1),)}, "reason of 1 to 64 characters"),
    ],
    ids=str,
)
def test_what_the_reader_would_refuse_is_not_written(tmp_path, unit, numbered, changes, words):
    recorder = RecordingWriter(tmp_path / "run", unit, "x")
    recorder.write(numbered(0, 10))
    with pytest.raises(ConfigError, match=words):
        recorder.write(numbered(**({"first_index": 20, "n_samples": 10} | changes)))
    recorder.write(numbered(20, 10, rejected=(Rejection("torn", 10),)))
    assert recorder.finish().n_blocks == 2


def test_a_manifest_says_when_it_began_and_who_made_it(record, numbered):
    first = numbered(0, 50, start_ns=1_767_225_600_008_333_333)
    manifest = open_recording(record([first, numbered(50, 50)])).manifest
    assert manifest.start == "2026-01-01T00:00:00.008333333Z"
    assert manifest.made_by == "padwatch in a test"


@pytest.mark.parametrize("dtype", [np.int16, np.float32])
def test_the_first_block_may_decide_what_is_recorded(tmp_path, unit, numbered, dtype):
    block = numbered(0, 50, counts=np.arange(100).reshape(2, 50).astype(dtype))
    with RecordingWriter(tmp_path / "run", unit, "x") as recorder:
        recorder.write(block)
    opened = open_recording(tmp_path / "run")
    assert opened.manifest.sample_type == np.dtype(dtype).name
    (found,) = opened.blocks()
    np.testing.assert_array_equal(found.counts, block.counts)


@given(
    st.one_of(arrays(np.int16, (2, 5)), arrays(np.float32, (2, 5), elements=st.floats(width=32))),
    st.tuples(st.booleans(), st.booleans()),
    st.tuples(st.floats(width=32), st.floats(-11.0, 121.0, width=32)),
)
def test_what_was_judged_is_judged_the_same_again(samples, ok, slow):
    limits = {"full_scale_v": 12.0, "unit_per_v": 250.0, "ok_min_v": 1.0, "ok_max_v": 11.0}
    recorded = RecordedUnit(
        unit="U1",
        rate_hz=600.0,
        channels=tuple(RecordedChannel(id=c, measurand=Measurand.GAP_UM, **limits) for c in "ab"),
        slow_channels=tuple(
            RecordedSlowChannel(id=c, unit="degC", minimum=-10.0, maximum=120.0) for c in "cd"
        ),
    )
    own = {"calibration": recorded.calibration}
    block = joined(
        [cell_block(1, n, n, 600.0, samples[:, n : n + 1], ok, slow, **own) for n in range(5)]
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run"
        with RecordingWriter(path, recorded, "x") as recorder:
            recorder.write(block)
        [again] = open_recording(path).blocks()
    assert again == block
    assert (again.channel_quality, again.slow) == (block.channel_quality, block.slow)
    assert again.samples.tobytes() == block.samples.tobytes()


def test_another_unit_or_calibration_is_refused(tmp_path, unit, numbered):
    block = numbered(0, 5)
    gains = tuple(c.model_copy(update={"unit_per_v": -251.0}) for c in unit.channels)
    for change in (
        {"unit": "U2"},
        {"rate_hz": 500.0},
        {"slow_channels": unit.slow_channels[:1]},
        {"channels": unit.channels[:1]},
        {"channels": gains},
    ):
        with (
            pytest.raises(ConfigError, match="in rate or calibration"),
            RecordingWriter(tmp_path / "run", unit.model_copy(update=change), "x") as recorder,
        ):
            recorder.write(block)
