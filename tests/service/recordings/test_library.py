"""Recordings around alarms and continuous ones side by side on one shelf."""

from pathlib import Path
from typing import Any

import pytest
from rigs.capturing import block, recorded_unit

from acquisition.recordings.writer import RecordingWriter
from service.recordings.library import RecordingLibrary
from service.store.waveforms import WaveformKind

FIRST = "U1-20260101T000000.000Z-continuous"
CAPTURE = "U1-20260101T000500.000Z-order1_shaft_x"
SECOND = "U1-20260101T001000.000Z-continuous-2"
OTHER = "U2-20260101T000200.000Z-continuous"
LONGER = "U1-2-20260101T000100.000Z-continuous"


def make(folder: Path) -> None:
    unit = folder.name[:2]
    folder.parent.mkdir(exist_ok=True)
    with RecordingWriter(folder, recorded_unit(unit), "a test") as writer:
        writer.write_block(block(0, unit))


@pytest.fixture
def shelf(tmp_path: Path) -> RecordingLibrary:
    captures, recordings = tmp_path / "captures", tmp_path / "recordings"
    make(captures / CAPTURE)
    for name in (FIRST, SECOND, OTHER, LONGER):
        make(recordings / name)
    (recordings / "U1-20260101T002000.000Z-continuous.parts").mkdir()
    return RecordingLibrary((captures, recordings))


@pytest.mark.parametrize(
    ("asked", "names"),
    [
        ((10,), [SECOND, CAPTURE, OTHER, LONGER, FIRST]),
        ((2, "U1"), [SECOND, CAPTURE]),
        ((10, None, WaveformKind.CAPTURE), [CAPTURE]),
        ((10, "U1", WaveformKind.CONTINUOUS), [SECOND, FIRST]),
        ((10, "U1-2"), [LONGER]),
    ],
)
def test_whole_recordings_are_listed_newest_first_by_unit_and_kind(
    shelf: RecordingLibrary, asked: tuple[Any, ...], names: list[str]
) -> None:
    found = shelf.newest(*asked)
    assert [kept.name for kept in found] == names
    assert {kept.kind for kept in found} >= set(asked[2:])


def test_one_of_either_kind_is_opened_by_its_name(shelf: RecordingLibrary) -> None:
    assert shelf.opened(CAPTURE).manifest.unit == "U1"
    assert shelf.opened(OTHER).manifest.unit == "U2"
    assert shelf.one("../captures") is None
