"""Bytes that change on the disk are refused; an error that passes says nothing of a recording."""

import errno
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness.corruption import CHANGES, corrupted

from acquisition.errors import ConfigError
from acquisition.recordings.reader import open_recording
from service.recordings import index as inspection
from service.recordings.index import RETRY_S, RecordingCheck, RecordingState
from service.recordings.library import RecordingLibrary
from service.store.waveforms import WaveformKind, WaveformState

CONTINUOUS = WaveformKind.CONTINUOUS
DAY_S = 86_400.0


@pytest.fixture
def refusal(monkeypatch: pytest.MonkeyPatch) -> dict[str, OSError]:
    """What the system says when a recording of that name is opened."""
    refused: dict[str, OSError] = {}

    def tried(folder: Path) -> Any:
        if folder.name in refused:
            raise ConfigError(f"{folder}: no") from refused[folder.name]
        return open_recording(folder)

    monkeypatch.setattr(inspection, "open_recording", tried)
    return refused


@pytest.mark.parametrize("number", [errno.EMFILE, errno.EIO, errno.ENOMEM])
def test_a_passing_error_makes_nothing_damaged(rig, refusal, number):
    folder, other = rig.make(0), rig.make(1)
    rig.caretaker.look()
    refusal[folder.name] = OSError(number, "not now")
    rig.clock.s = DAY_S + 1.0
    with pytest.raises(OSError, match="not now"):
        rig.caretaker.look()
    with pytest.raises(OSError, match="not now"):  # it is told until it can be read
        rig.caretaker.look()
    checked = {file.name: file.checked_ns for file in rig.files()}
    assert checked[other.name] > checked[folder.name]  # it holds up no other
    assert not rig.caretaker.faults
    del refusal[folder.name]
    rig.clock.s += RETRY_S
    rig.caretaker.look()

    assert [file.state for file in rig.files()] == [WaveformState.PRESENT] * 2
    assert len({file.checked_ns for file in rig.files()} & set(checked.values())) == 1


def test_a_passing_error_renames_nothing_that_is_new(rig, refusal):
    folder, other = rig.make(0), rig.make(1)
    refusal[folder.name] = OSError(errno.EMFILE, "Too many open files")
    with pytest.raises(OSError, match=f"Too many open files: '{folder.name}'"):
        rig.caretaker.look()
    assert rig.names() == [folder.name, other.name]
    assert [file.name for file in rig.files()] == [other.name]
    refusal.clear()
    rig.clock.s += RETRY_S
    rig.caretaker.look()

    assert [file.name for file in rig.files()] == [folder.name, other.name]


def test_the_check_of_all_names_what_cannot_be_read_and_goes_on(rig, refusal):
    folder, other = rig.make(0), rig.make(1)
    rig.caretaker.look()
    refusal[folder.name] = OSError(errno.EIO, "Input/output error")
    one, two = RecordingCheck(rig.roots, rig.files(), rig.clock.now_ns()).results()

    assert (one.name, one.found) == (folder.name, RecordingState.DAMAGED)
    assert one.reason == "the recording cannot be read: Input/output error"
    assert (two.name, two.found) == (other.name, RecordingState.SOUND)


def test_memory_that_is_short_makes_nothing_damaged(rig, monkeypatch):
    def short(_: Path) -> Any:
        raise ConfigError("no") from MemoryError()

    folder = rig.make(0)
    monkeypatch.setattr(inspection, "open_recording", short)
    with pytest.raises(OSError, match="Cannot allocate memory"):
        rig.caretaker.look()
    assert rig.names() == [folder.name]


def test_nothing_of_a_recording_that_is_known_to_be_damaged_is_handed_out(rig):
    folder = rig.make(0)
    shelf = RecordingLibrary(
        (rig.roots[WaveformKind.CONTINUOUS],), {folder.name: "a bit has flipped"}
    )

    for read in (shelf.opened, shelf.summary, shelf.zip_pieces):
        with pytest.raises(ConfigError, match="a bit has flipped"):
            read(folder.name)
    with pytest.raises(ConfigError, match="a bit has flipped"):
        next(shelf.csv_pieces(folder.name))
    kept = shelf.one(folder.name)
    assert kept is not None
    assert kept.fault == "a bit has flipped"


def test_every_damage_is_noticed_when_the_recording_is_read_once_more(rig):
    folder = rig.make(0)
    rig.caretaker.look()
    [entry] = rig.files()
    rng = np.random.default_rng(7)
    for path in sorted(folder.iterdir()):
        whole = path.read_bytes()
        for damage in CHANGES:
            path.write_bytes(corrupted(whole, damage, rng))
            assert rig.caretaker.check(entry).state is WaveformState.DAMAGED, (path.name, damage)
        path.write_bytes(whole)
    manifest = folder / "manifest.json"
    whole = manifest.read_bytes()
    manifest.write_bytes(whole + b" " * 1_000_001)  # too long to be read: no error of the disk
    checked = rig.caretaker.check(entry)
    assert (checked.state, "larger than 1000000 bytes" in checked.reason) == (
        WaveformState.DAMAGED,
        True,
    )
    manifest.write_bytes(whole)
    assert rig.caretaker.check(entry).state is WaveformState.PRESENT
