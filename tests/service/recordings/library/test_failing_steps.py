"""Whatever fails, room is made, and what is left to be told is told later."""

import errno
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from service.app.analysis import Analysis
from service.recordings.library import RecordingLibrary
from service.runtime.disk import DiskSpace
from service.store.port import StoreError
from service.store.waveforms import WaveformFile, WaveformKind, WaveformState, WaveformStore

CONTINUOUS, CAPTURE = WaveformKind.CONTINUOUS, WaveformKind.CAPTURE
FULL = DiskSpace(1, 10**12, 0)
DAY_S = 86_400.0


@pytest.fixture
def index(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The index, which takes nothing while it is away."""
    index, put = SimpleNamespace(is_away=False), WaveformStore.put

    def refused(stored: WaveformStore, files: Sequence[WaveformFile]) -> None:
        if index.is_away:
            raise StoreError("database or disk is full")
        put(stored, files)

    monkeypatch.setattr(WaveformStore, "put", refused)
    return index


def test_a_full_disk_is_freed_though_the_index_cannot_be_written(rig, index):
    for hour in range(3):
        rig.make(hour)
    rig.caretaker.look()
    new = rig.make(3)
    rig.space, index.is_away = FULL, True
    for _ in range(2):
        with pytest.raises(StoreError, match="disk is full"):
            rig.caretaker.look()

    assert rig.gauge.is_full
    left = rig.roots[CONTINUOUS].rglob("samples.parquet")
    assert [path.parent.name for path in left] == [new.name]  # not in the index yet
    assert rig.caretaker.found.n_removed == {"continuous": 3}

    rig.space, index.is_away = DiskSpace(1, 10**12, 10**12), False
    rig.caretaker.look()
    assert not rig.gauge.is_full
    assert rig.names() == [new.name]
    assert [file.name for file in rig.files()] == [new.name]
    assert rig.caretaker.found.n_missing == 0


def test_what_could_not_be_told_before_a_restart_is_not_taken_for_a_loss(rig, index):
    rig.make(0)
    rig.caretaker.look()
    rig.space, index.is_away = FULL, True
    with pytest.raises(StoreError):
        rig.caretaker.look()
    rig.hire()
    index.is_away = False
    rig.caretaker.look()

    assert rig.files() == rig.names() == []
    assert (rig.caretaker.found.n_missing, rig.caretaker.found.n_damaged) == (0, 0)


def test_one_that_comes_back_before_its_removal_was_told_is_there(rig, index, tmp_path):
    folder = rig.make(0)
    shutil.copytree(folder, tmp_path / "copy")
    rig.caretaker.look()
    rig.space, index.is_away = FULL, True
    with pytest.raises(StoreError):
        rig.caretaker.look()
    rig.space, index.is_away = DiskSpace(1, 10**12, 10**12), False
    shutil.copytree(tmp_path / "copy", folder)
    rig.caretaker.look()

    assert [file.state for file in rig.files()] == [WaveformState.PRESENT]
    assert rig.names() == [folder.name]


def test_files_of_others_in_a_removed_folder_stay_and_stop_nothing(rig):
    annotated, other = rig.make(0), rig.make(1)
    rig.caretaker.look()
    (annotated / "notes.txt").write_text("to be kept")
    rig.space = FULL
    rig.caretaker.look()
    left = annotated.with_name(f"{annotated.name}.left")
    assert rig.names() == [left.name]
    assert not other.exists()
    assert [path.name for path in left.iterdir()] == ["notes.txt"]

    rig.caretaker.look()
    assert rig.names() == [left.name]
    assert rig.files() == []
    assert RecordingLibrary((rig.roots[CONTINUOUS],)).newest(10) == []


def test_a_folder_that_is_away_stops_nothing_in_another(rig, tmp_path):
    rig.make(0, CAPTURE)
    rig.make(0)
    rig.caretaker.look()
    rig.roots[CAPTURE].rename(tmp_path / "unmounted")
    new = rig.make(1)
    rig.clock.s = 2 * DAY_S
    with pytest.raises(OSError, match="captures: the folder of recordings"):
        rig.caretaker.look()
    assert new.name in [file.name for file in rig.files()]
    assert not rig.caretaker.faults  # the capture that is away was to be read, and was not
    rig.space = FULL
    with pytest.raises(OSError, match="captures: the folder of recordings"):
        rig.caretaker.look()

    assert rig.gauge.is_full
    assert rig.names() == []


def test_one_that_cannot_be_removed_costs_the_next_one(rig):
    stuck, old, young = (rig.make(hour) for hour in range(3))
    rig.caretaker.look()
    size = max(file.n_bytes for file in rig.files())
    shutil.copytree(stuck, stuck.with_name(f"{stuck.name}.removed"))
    (stuck.with_name(f"{stuck.name}.removed") / "manifest.json").unlink()
    (stuck.with_name(f"{stuck.name}.removed") / "manifest.json").mkdir()
    rig.limit(continuous_bytes=round(2.5 * size))
    with pytest.raises(OSError, match=r"manifest\.json"):
        rig.caretaker.look()

    assert (stuck.exists(), old.exists(), young.exists()) == (True, False, True)


def test_evidence_that_cannot_be_read_costs_no_room_for_continuous_ones(rig, monkeypatch):
    def refused(_: object) -> frozenset[str]:
        raise OSError(errno.EIO, "Input/output error")

    for hour in range(2):
        rig.make(hour, CAPTURE)
        rig.make(hour)
    rig.caretaker.look()
    monkeypatch.setattr(type(rig), "bound", property(refused), raising=False)
    rig.space = FULL
    with pytest.raises(OSError, match="Input/output error"):
        rig.caretaker.look()

    assert rig.names() == []
    assert len(rig.names(CAPTURE)) == 2


def test_room_is_measured_though_nobody_can_look_after_the_recordings(rig):
    def hire() -> Any:
        raise StoreError("the database is away")

    rig.space = FULL
    keeper = rig.keeper(hire)
    keeper.look()
    second = rig.keeper(hire)
    assert (keeper.is_full(), second.is_full()) == (True, True)
    rig.space = DiskSpace(1, 10**12, 10**12)
    second.look()  # which another process has the watch for

    assert (keeper.trouble, second.trouble) == ("the database is away", None)
    assert not second.is_full()
    keeper.close()


def test_a_disk_that_does_not_say_leaves_the_others_measured(rig):
    def measured(root: Path) -> DiskSpace:
        if root == rig.roots[CAPTURE]:
            raise OSError(errno.EIO, "Input/output error")
        return FULL

    rig.make(0)
    rig.caretaker.look()
    rig.measured = measured
    rig.hire()
    with pytest.raises(OSError, match="Input/output error"):
        rig.caretaker.look()

    assert rig.gauge.is_full
    assert rig.names() == []


def test_what_goes_on_failing_for_a_minute_is_an_alarm(rig, index):
    keeper = rig.keeper(lambda: rig.caretaker)
    parts: Any = SimpleNamespace(tape=SimpleNamespace(trouble=None), recordings=keeper)
    folder = rig.make(0)
    index.is_away = True
    keeper.look()
    assert rig.names() == [folder.name]  # nothing is lost
    rig.clock.s += 55.0
    keeper.look()
    assert Analysis.recording_error.fget(parts) is None
    rig.clock.s += 5.0
    found = Analysis.recording_error.fget(parts)
    assert found == "recordings are not maintained: database or disk is full"
    index.is_away = False
    keeper.look()

    assert Analysis.recording_error.fget(parts) is None
    keeper.close()


def test_a_folder_that_is_closed_holds_up_no_other(rig, monkeypatch):
    listed = Path.iterdir

    def refused(folder: Path) -> Iterator[Path]:
        if folder.name in closed:
            raise PermissionError(errno.EACCES, "Permission denied", str(folder))
        return listed(folder)

    closed = {"lost+found"}
    monkeypatch.setattr(Path, "iterdir", refused)
    for name in ("U1-20250101T000000.000Z-continuous", "lost+found"):
        (rig.roots[CONTINUOUS] / name).mkdir()
    rig.make(0)
    rig.caretaker.look()
    assert len(rig.files()) == 1
    closed.add("U1-20250101T000000.000Z-continuous")
    new, _ = rig.make(1), rig.hire()
    with pytest.raises(OSError, match="Permission denied: 'U1-2025"):
        rig.caretaker.look()

    assert new.name in [file.name for file in rig.files()]
