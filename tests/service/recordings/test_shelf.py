"""Recordings around alarms and continuous ones side by side on one shelf."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.raw import RawBlock
from acquisition.recording.manifest import RecordedChannel, RecordedUnit
from acquisition.recording.writer import RecordingWriter
from core.machine import Measurand
from service.recordings.shelf import Shelf
from service.store.waveform_port import WaveformKind

FIRST = "U1-20260101T000000.000Z-continuous"
CAPTURE = "U1-20260101T000500.000Z-order1_shaft_x"
SECOND = "U1-20260101T001000.000Z-continuous-2"
OTHER = "U2-20260101T000200.000Z-continuous"


def make(folder: Path) -> None:
    limits = {"full_scale_v": 10.0, "unit_per_v": 1.0, "ok_min_v": -10.0, "ok_max_v": 10.0}
    channel = RecordedChannel(id="a", measurand=Measurand.DISPLACEMENT_UM, **limits)
    unit = RecordedUnit(unit=folder.name[:2], rate_hz=50.0, channels=(channel,), slow_channels=())
    folder.parent.mkdir(exist_ok=True)
    with RecordingWriter(folder, unit, "a test") as writer:
        counts = np.zeros((1, 50), dtype=np.int16)
        writer.write(RawBlock(1, 0, 1_767_225_600_000_000_000, 50.0, counts, (True,), ()))


@pytest.fixture
def shelf(tmp_path: Path) -> Shelf:
    captures, recordings = tmp_path / "captures", tmp_path / "recordings"
    make(captures / CAPTURE)
    for name in (FIRST, SECOND, OTHER):
        make(recordings / name)
    (recordings / "U1-20260101T002000.000Z-continuous.parts").mkdir()
    return Shelf((captures, recordings))


def test_all_are_listed_newest_first_without_those_that_are_being_written(shelf: Shelf) -> None:
    assert [kept.name for kept in shelf.newest(10)] == [SECOND, CAPTURE, OTHER, FIRST]
    assert [kept.name for kept in shelf.newest(2, "U1")] == [SECOND, CAPTURE]


def test_each_kind_can_be_asked_for_alone(shelf: Shelf) -> None:
    captures = shelf.newest(10, kind=WaveformKind.CAPTURE)
    continuous = shelf.newest(10, "U1", WaveformKind.CONTINUOUS)

    assert [kept.name for kept in captures] == [CAPTURE]
    assert [kept.name for kept in continuous] == [SECOND, FIRST]
    assert {kept.kind for kept in continuous} == {WaveformKind.CONTINUOUS}


def test_one_of_either_kind_is_opened_by_its_name(shelf: Shelf) -> None:
    assert shelf.opened(CAPTURE).manifest.unit == "U1"
    assert shelf.opened(OTHER).manifest.unit == "U2"
    assert shelf.one("../captures") is None
