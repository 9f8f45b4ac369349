"""A recording that is exported and imported again is the same recording."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rigs.blocks import cell_block

from acquisition.delivery.blocks import BlockJoiner
from acquisition.recordings.export import ExportFormat, export_recording
from acquisition.recordings.imports.job import (
    ChannelColumn,
    ColumnName,
    ImportJob,
    SlowColumn,
    TimeAxis,
)
from acquisition.recordings.manifest import RecordedChannel, RecordedSlowChannel, RecordedUnit
from acquisition.recordings.reader import Recording, open_recording
from acquisition.recordings.writer import RecordingWriter
from core.machine.channel import Measurand

START_NS = 1_767_225_600_000_000_000
MEASURANDS = {
    "gap": (Measurand.GAP_UM, "um"),
    "velocity": (Measurand.VELOCITY_MM_S, "mm/s"),
    "acceleration": (Measurand.ACCELERATION_M_S2, "m/s2"),
    "kp": (Measurand.KEY_PHASE_V, "V"),
}
SLOW = {"oil": "degC", "speed": "r/min", "power": "MW", "slow_gap": "mm"}


@pytest.fixture
def recording(tmp_path: Path, sample_type: str) -> Recording:
    """A minute of four kinds of channels, with gaps on the way and a restart near the end."""
    unit = RecordedUnit(
        unit="U1",
        rate_hz=600.0,
        channels=tuple(
            RecordedChannel(
                id=id_, measurand=m, full_scale_v=10.0, unit_per_v=1e3, ok_min_v=-11, ok_max_v=11
            )
            for id_, (m, _) in MEASURANDS.items()
        ),
        slow_channels=tuple(
            RecordedSlowChannel(id=id_, unit=u, minimum=-1e6, maximum=1e6)
            for id_, u in SLOW.items()
        ),
        sample_type=sample_type,
    )
    chance = np.random.default_rng(5)
    with RecordingWriter(tmp_path / "recording", unit, "a test") as writer:
        for number in range(720):
            if number % 90 == 7:
                continue
            epoch, first = (1, 50 * number) if number < 700 else (2, 50 * (number - 700))
            pause_ns = 0 if epoch == 1 else 3_334_166_000
            samples = chance.standard_normal((4, 50)).astype(np.float32)
            if sample_type == "int16":
                samples = chance.integers(-32767, 32767, (4, 50)).astype(np.int16)
            elif number == 300:
                samples[2] = np.nan
            writer.write(
                cell_block(
                    epoch=epoch,
                    first_index=first,
                    start_ns=START_NS + 50 * number * 10**7 // 6 // 1000 * 1000 + pause_ns,
                    rate_hz=600.0,
                    counts=samples,
                    ok=(True,) * 4,
                    slow=(40.0 + number // 60, 92.25, float("nan"), chance.integers(9) / 8),
                    calibration=unit.calibration,
                )
            )
    return open_recording(tmp_path / "recording")


JOB = ImportJob(
    format="csv",
    rate_hz=600.0,
    time=TimeAxis("column", 0, ColumnName("time_utc"), "iso8601"),
    channels=tuple(
        ChannelColumn(id_, ColumnName(f"{id_} [{unit}]"), unit, 1.0, 1.0)
        for id_, (_, unit) in MEASURANDS.items()
    ),
    slow=tuple(
        SlowColumn(id_, ColumnName(f"{id_} [{unit}]"), unit, 1.0) for id_, unit in SLOW.items()
    ),
)
"""As somebody who looks into the exported file would map it."""


@pytest.mark.parametrize("sample_type", ["float32", "int16"])
def test_every_block_is_the_same_to_the_last_bit(recording, tmp_path, read):
    export_recording(recording, ExportFormat.CSV, tmp_path / "run.csv")
    found = read(tmp_path / "run.csv", JOB)
    calibration = recording.manifest.calibration
    joiner = BlockJoiner(50)
    imported = (replace(block, calibration=calibration) for block in found.blocks)
    blocks = joiner.put(imported) + joiner.flush()
    cells = [cell for block in blocks for cell in block.cells()]
    recorded = [cell for block in recording.blocks() for cell in block.cells()]
    for again, before in itertools.zip_longest(cells, recorded):
        assert again.epoch == before.epoch - 1
        assert again.first_index == before.first_index
        assert again.start_ns == before.start_ns
        np.testing.assert_array_equal(again.side.slow, before.side.slow)
        assert again.samples.tobytes() == before.samples.tobytes()
        assert again.channel_quality == before.channel_quality
