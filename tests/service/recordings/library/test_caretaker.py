"""Index and folders are brought together, whatever has happened to either; who sees to it."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from service.recordings.folders import begin_removal, place_of
from service.recordings.index import reinspected
from service.store.waveforms import WaveformKind, WaveformState

CONTINUOUS, CAPTURE = WaveformKind.CONTINUOUS, WaveformKind.CAPTURE
T0 = 1_767_225_600_000_000_000
DAY_S = 86_400.0


def flip(path: Path, at: int = 100) -> None:
    content = bytearray(path.read_bytes())
    content[at] ^= 0x10
    path.write_bytes(content)


def test_what_is_finished_is_found_and_entered_with_all_that_is_known_of_it(rig: Any) -> None:
    folder = rig.make(0)
    rig.make(1, CAPTURE, "U2")
    rig.caretaker.look()

    one, two = rig.files()
    assert (one.kind, one.name, one.unit) == (CONTINUOUS, folder.name, "U1")
    assert (one.start_ns, one.stop_ns, one.n_samples) == (T0, T0 + 10 * 10**9, 500)
    assert one.changed_ns == rig.clock.now_ns()
    assert one.n_bytes == sum(path.stat().st_size for path in folder.iterdir())
    assert (two.kind, two.unit, two.state) == (CAPTURE, "U2", WaveformState.PRESENT)
    assert rig.caretaker.found.n_adopted == 2


def test_what_is_being_written_and_what_is_not_ours_is_let_alone(rig: Any) -> None:
    root = rig.roots[CONTINUOUS]
    for name in ("U1-x-continuous.parts", "U1-x-continuous.incomplete", "lost+found", "notes"):
        (root / name).mkdir()
    (root / "notes" / "why.txt").write_text("to be kept")
    (root / "U1-y-continuous").symlink_to(rig.make(0, CAPTURE))
    before = rig.names()
    rig.caretaker.look()

    assert [file.kind for file in rig.files()] == [CAPTURE]
    assert rig.names() == before


def test_an_orphan_that_is_not_whole_is_set_aside_and_told_once(rig: Any) -> None:
    folder = rig.make(0)
    flip(folder / "samples.parquet")
    rig.caretaker.look()
    rig.hire()
    rig.caretaker.look()

    [file] = rig.files()
    assert file.name == f"{folder.name}.damaged"
    assert file.state is WaveformState.DAMAGED
    assert "checksum" in file.reason
    assert rig.names() == [file.name]
    assert rig.caretaker.found.n_damaged == 0  # told before the restart


def test_a_recording_that_is_gone_is_missing_and_found_again_when_it_is_back(
    rig: Any, tmp_path: Path
) -> None:
    folder = rig.make(0)
    rig.caretaker.look()
    shutil.move(folder, tmp_path / "elsewhere")
    rig.caretaker.look()
    assert [file.state for file in rig.files()] == [WaveformState.MISSING]
    assert rig.caretaker.found.n_missing == 1

    shutil.move(tmp_path / "elsewhere", folder)
    rig.caretaker.look()
    assert [file.state for file in rig.files()] == [WaveformState.PRESENT]


@pytest.mark.parametrize("name", ["samples.parquet", "blocks.parquet", "manifest.json"])
def test_a_bit_that_flips_later_is_found_when_all_is_read_once_more(rig: Any, name: str) -> None:
    folder = rig.make(0)
    rig.make(1)
    rig.caretaker.look()
    flip(folder / name)
    rig.clock.s = DAY_S - 1.0
    rig.caretaker.look()
    assert not rig.caretaker.faults
    rig.clock.s = DAY_S + 1.0
    rig.caretaker.look()
    rig.caretaker.look()

    assert list(rig.caretaker.faults) == [folder.name]
    assert rig.caretaker.found.n_damaged == 1
    assert rig.names() == [folder.name, "U1-001-continuous"]


def test_another_recording_in_the_place_of_one_is_not_taken_for_it(
    rig: Any, make_recording: Any
) -> None:
    folder = rig.make(0)
    rig.caretaker.look()
    shutil.rmtree(folder)
    make_recording(folder, T0 + 77)
    rig.clock.s = DAY_S + 1.0
    rig.caretaker.look()

    assert "the manifest has changed" in rig.caretaker.faults[folder.name]


def test_what_is_read_once_more_takes_a_small_share_of_the_time(
    rig: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow(*how: Any) -> Any:
        rig.clock.s += 4.0
        return reinspected(*how)

    for hour in range(3):
        rig.make(hour)
    rig.caretaker.look()
    monkeypatch.setattr("service.recordings.retention.reinspected", slow)
    rig.clock.s = DAY_S + 1.0
    for _ in range(100):
        rig.caretaker.look()
        rig.clock.s += 5.0

    assert rig.caretaker.found.n_checked == 3  # 4 s in every 200 s


def test_a_removal_that_a_kill_has_interrupted_is_finished(rig: Any) -> None:
    folder, other = rig.make(0), rig.make(1)
    rig.caretaker.look()
    begin_removal(folder)
    rig.hire()
    rig.caretaker.look()

    assert rig.names() == [other.name]
    assert [file.name for file in rig.files()] == [other.name]
    assert rig.caretaker.found.n_missing == 0
    assert rig.caretaker.found.n_removed == {"continuous": 1}


def test_what_there_is_is_counted_and_what_is_damaged_is_named(rig: Any) -> None:
    folder = rig.make(0)
    (rig.make(1) / "manifest.json").write_text("{}")
    keeper = rig.keeper()
    keeper.look()

    assert keeper.n_files[CONTINUOUS] == 2
    assert keeper.n_bytes[CONTINUOUS] > sum(path.stat().st_size for path in folder.iterdir())
    assert list(keeper.faults) == ["U1-001-continuous.damaged"]
    assert keeper.n_lost == 1
    assert keeper.trouble is None
    keeper.close()


def test_only_one_process_looks_after_a_folder_and_another_takes_over(rig: Any) -> None:
    rig.make(0)
    first, second = rig.keeper(), rig.keeper()
    first.look()
    second.look()
    assert (first.n_files[CONTINUOUS], dict(second.n_files)) == (1, {})

    first.close()
    second.look()
    assert second.n_files[CONTINUOUS] == 1
    second.close()


def test_a_disk_that_is_away_is_told_and_its_recordings_are_not_given_up(
    rig: Any, tmp_path: Path
) -> None:
    rig.make(0)
    keeper = rig.keeper()
    keeper.look()
    rig.roots[CONTINUOUS].rename(tmp_path / "unmounted")
    keeper.look()
    assert keeper.trouble is not None
    assert "folder of 1 recordings does not exist" in keeper.trouble
    assert [file.state for file in rig.files()] == [WaveformState.PRESENT]
    (tmp_path / "unmounted").rename(rig.roots[CONTINUOUS])
    keeper.look()

    assert keeper.trouble is None
    assert keeper.n_lost == 0
    keeper.close()


def test_a_data_folder_keeps_its_name_and_no_two_have_the_same(tmp_path: Path) -> None:
    one, two = place_of(tmp_path / "one"), place_of(tmp_path / "two")

    assert place_of(tmp_path / "one") == one
    assert one != two
