"""`padwatch recording check`: what is damaged, missing or not yet entered is named."""

import json
import shutil
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigs.command_line import padwatch

from acquisition.clock import SystemClock
from acquisition.delivery.blocks import RawBlock
from acquisition.recordings.manifest import RecordedUnit
from acquisition.recordings.writer import RecordingWriter
from service.app.storage import open_store, waveform_keeper
from service.settings.adapter_values import recorded_unit
from service.settings.loading import load_plant_file

START_NS = 1_767_225_600_000_000_000


def make(folder: Path, unit: RecordedUnit) -> Path:
    counts = np.arange(600 * len(unit.channels), dtype=np.int16).reshape(len(unit.channels), -1)
    slow = (1.0,) * len(unit.slow_channels)
    with RecordingWriter(folder, unit, "a test") as writer:
        ok = (True,) * len(unit.channels)
        writer.write(RawBlock(1, 0, START_NS, unit.rate_hz, counts, ok, slow))
    return folder


@pytest.fixture
def plant(plant_path: Path) -> Path:
    """A plant with three recordings in its index, as a running service has left them."""
    settings = load_plant_file(plant_path)
    root = plant_path.parent / "data" / "recordings"
    root.mkdir(parents=True)
    for number in range(3):
        make(root / f"U1-{number}", recorded_unit(settings.unit[0]))
    with closing(open_store(settings)) as store:
        keeper = waveform_keeper(settings, store, SystemClock())
        keeper.look()
        keeper.close()
    return plant_path


def run(plant: Path, *options: str) -> Any:
    return padwatch("recording", "check", plant, *options)


def test_a_plant_whose_recordings_are_whole_is_said_to_be(plant: Path) -> None:
    found = run(plant)

    assert found.exit_code == 0, found.output
    assert found.output.strip() == "3 sound, 0 not entered, 0 damaged, 0 missing, 0 unfinished"


def test_each_recording_with_something_wrong_is_named_with_it(plant: Path) -> None:
    root = plant.parent / "data" / "recordings"
    shutil.rmtree(root / "U1-0")
    samples = root / "U1-1" / "samples.parquet"
    samples.write_bytes(samples.read_bytes()[:-1])
    make(root / "U1-3", recorded_unit(load_plant_file(plant).unit[0]))
    (root / "U1-4.incomplete").mkdir()
    before = sorted(path.name for path in root.iterdir())

    found = run(plant, "--json")
    assert found.exit_code == 1
    document = json.loads(found.output)
    assert [(each["name"], each["found"]) for each in document["recordings"]] == [
        ("U1-1", "damaged"),
        ("U1-3", "not_entered"),
        ("U1-0", "missing"),
        ("U1-4.incomplete", "unfinished"),
    ]
    assert document["sound"] == 1
    assert "bytes, expected" in document["recordings"][0]["reason"]
    assert sorted(path.name for path in root.iterdir()) == before


def test_a_plant_without_recordings_is_told_where_they_would_be_and_what_checks_others(
    plant_path: Path,
) -> None:
    found = run(plant_path)

    assert found.exit_code == 0
    assert f"no recordings in {plant_path.parent / 'data' / 'captures'} or" in found.output
    assert "padwatch recording verify FOLDER" in found.output
    assert not (plant_path.parent / "data").exists()
