"""Who looks after recordings, and what is known of it while he does."""

from pathlib import Path
from typing import Any

from service.store.waveform_port import WaveformKind, WaveformState
from service.waveforms.place import place_of

CONTINUOUS = WaveformKind.CONTINUOUS


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
    assert "folder of 1 recordings is not there" in keeper.trouble
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
