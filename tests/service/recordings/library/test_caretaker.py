"""A library of recordings is looked after: what there is, what is damaged, and room for more."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from service.recordings.folders import begin_removal, place_of
from service.recordings.index import reinspected
from service.recordings.retention import AgeLimit
from service.runtime.disk import DiskSpace
from service.store.waveforms import WaveformFile, WaveformKind, WaveformState

CONTINUOUS, CAPTURE = WaveformKind.CONTINUOUS, WaveformKind.CAPTURE
T0 = 1_767_225_600_000_000_000
DAY_S = 86_400.0


def flip(path: Path, at: int = 100) -> None:
    content = bytearray(path.read_bytes())
    content[at] ^= 0x10
    path.write_bytes(content)


def test_what_is_finished_is_found_and_entered_with_all_that_is_known_of_it(rig):
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


def test_what_is_being_written_and_what_is_not_ours_is_let_alone(rig):
    root = rig.roots[CONTINUOUS]
    for name in ("U1-x-continuous.parts", "U1-x-continuous.incomplete", "lost+found", "notes"):
        (root / name).mkdir()
    (root / "notes" / "why.txt").write_text("to be kept")
    (root / "U1-y-continuous").symlink_to(rig.make(0, CAPTURE))
    before = rig.names()
    rig.caretaker.look()

    assert [file.kind for file in rig.files()] == [CAPTURE]
    assert rig.names() == before


def test_an_orphan_that_is_not_whole_is_set_aside_and_told_once(rig):
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


def test_a_recording_that_is_gone_is_missing_and_found_again_when_it_is_back(rig, tmp_path):
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
def test_a_bit_that_flips_later_is_found_when_all_is_read_once_more(rig, name):
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


def test_another_recording_in_the_place_of_one_is_not_taken_for_it(rig, make_recording):
    folder = rig.make(0)
    rig.caretaker.look()
    shutil.rmtree(folder)
    make_recording(folder, T0 + 77)
    rig.clock.s = DAY_S + 1.0
    rig.caretaker.look()

    assert "the manifest has changed" in rig.caretaker.faults[folder.name]


def test_what_is_read_once_more_takes_a_small_share_of_the_time(rig, monkeypatch):
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


def test_a_removal_that_a_kill_has_interrupted_is_finished(rig):
    folder, other = rig.make(0), rig.make(1)
    rig.caretaker.look()
    begin_removal(folder)
    rig.hire()
    rig.caretaker.look()

    assert rig.names() == [other.name]
    assert [file.name for file in rig.files()] == [other.name]
    assert rig.caretaker.found.n_missing == 0
    assert rig.caretaker.found.n_removed == {"continuous": 1}


def test_what_there_is_is_counted_and_what_is_damaged_is_named(rig):
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


def test_only_one_process_looks_after_a_folder_and_another_takes_over(rig):
    rig.make(0)
    first, second = rig.keeper(), rig.keeper()
    first.look()
    second.look()
    assert (first.n_files[CONTINUOUS], dict(second.n_files)) == (1, {})

    first.close()
    second.look()
    assert second.n_files[CONTINUOUS] == 1
    second.close()


def test_a_disk_that_is_away_is_told_and_its_recordings_are_not_given_up(rig, tmp_path):
    rig.make(0)
    keeper = rig.keeper()
    keeper.look()
    rig.roots[CONTINUOUS].rename(tmp_path / "unmounted")
    keeper.look()
    assert keeper.trouble is not None
    assert "folder of recordings (1 in the index) is missing" in keeper.trouble
    assert [file.state for file in rig.files()] == [WaveformState.PRESENT]
    (tmp_path / "unmounted").rename(rig.roots[CONTINUOUS])
    keeper.look()

    assert keeper.trouble is None
    assert keeper.n_lost == 0
    keeper.close()


def test_a_data_folder_keeps_its_name_and_no_two_have_the_same(tmp_path):
    one, two = place_of(tmp_path / "one"), place_of(tmp_path / "two")

    assert place_of(tmp_path / "one") == one
    assert one != two


def size_of(rig: Any) -> int:
    rig.caretaker.look()
    return max(int(file.n_bytes) for file in rig.files())


def test_the_oldest_go_when_all_together_are_too_large(rig):
    folders = [rig.make(hour) for hour in range(5)]
    rig.limit(continuous_bytes=round(2.5 * size_of(rig)))
    rig.caretaker.look()

    assert rig.names() == [folder.name for folder in folders[3:]]
    assert [file.name for file in rig.files()] == rig.names()
    assert rig.caretaker.found.n_removed == {"continuous": 3}


def test_what_is_too_old_goes_however_much_room_there_is(rig):
    old = rig.make(0)
    rig.limit(continuous_days=1.0)
    rig.caretaker.look()
    young = rig.make_day(8)
    rig.clock.s = 32 * 3600.0
    rig.caretaker.look()

    assert not old.exists()
    assert rig.names() == young


def test_captures_have_a_limit_of_their_own_and_evidence_stays_longest(rig):
    names = [rig.make(hour, CAPTURE).name for hour in range(4)]
    continuous = rig.make(0)
    rig.bound = frozenset([names[0], names[2]])
    rig.limit(capture_bytes=round(2.5 * size_of(rig)))
    rig.caretaker.look()
    # the first that nothing refers to, then the oldest; the newest in no case
    assert rig.names(CAPTURE) == names[2:]
    assert continuous.exists()


def test_a_disk_that_is_nearly_full_costs_continuous_recordings_only(rig):
    captures = [rig.make(hour, CAPTURE).name for hour in range(3)]
    kept = [rig.make(hour).name for hour in range(4)]
    size = size_of(rig)
    total = 1000 * size
    rig.space = DiskSpace(1, total, round(0.11 * total - 1.5 * size))
    rig.caretaker.look()

    assert rig.names() == kept[2:]
    assert rig.names(CAPTURE) == captures
    assert not rig.gauge.is_full


def test_a_full_disk_costs_captures_too_but_no_evidence_and_not_the_newest(rig):
    captures = [rig.make(hour, CAPTURE).name for hour in range(4)]
    rig.make(0)
    rig.bound = frozenset(captures[:1])
    size_of(rig)
    rig.space = DiskSpace(1, 10**12, 0)
    rig.caretaker.look()

    assert rig.names() == []
    assert rig.names(CAPTURE) == [captures[0], captures[3]]
    assert rig.gauge.is_full


def test_what_cannot_be_read_is_not_the_oldest_for_that(rig):
    broken = rig.make(0)
    (broken / "manifest.json").unlink()
    rig.limit(continuous_days=1.0)
    rig.caretaker.look()

    assert [file.name for file in rig.files()] == [f"{broken.name}.damaged"]


HOUR_NS = 3600 * 10**9
DAY_NS, YEAR_NS = 24 * HOUR_NS, 365 * 24 * HOUR_NS
NOW_NS = 1_767_225_600_000_000_000


def file_of(stop_ns: int, length_ns: int = HOUR_NS, unit: str = "U1") -> WaveformFile:
    """A recording that was found when it was finished."""
    span = (stop_ns - length_ns, stop_ns)
    kind = WaveformKind.CONTINUOUS
    return WaveformFile("here", kind, str(stop_ns), unit, *span, 1, 1, "", changed_ns=stop_ns)


def day_of(stop_ns: int, unit: str = "U1") -> list[WaveformFile]:
    """A day of recordings."""
    return [file_of(stop_ns - hour * HOUR_NS, unit=unit) for hour in range(24)]


def old(files: list[WaveformFile], now_ns: int = NOW_NS) -> list[WaveformFile]:
    """Those that are older than two days."""
    not_old = AgeLimit(files, now_ns, 2 * DAY_NS)
    return [file for file in files if not_old.is_old(file)]


def test_ages_count_from_where_a_day_of_recordings_begins():
    newest = day_of(NOW_NS)
    since_ns = NOW_NS - 23 * HOUR_NS - 2 * DAY_NS
    gone, kept = file_of(since_ns - 1), file_of(since_ns)

    assert old([*newest, gone, kept]) == [gone]
    assert old([*newest[1:], gone]) == []  # which is less than a day


def test_a_recording_during_which_a_clock_was_set_is_no_day_of_recordings():
    across = file_of(NOW_NS + YEAR_NS, YEAR_NS)

    assert old([*day_of(NOW_NS), across], NOW_NS + YEAR_NS) == []


def test_what_a_device_records_in_the_year_2000_is_as_old_as_when_it_was_found():
    begun_anew = [
        replace(file_of(NOW_NS - 26 * YEAR_NS), changed_ns=NOW_NS - days * DAY_NS)
        for days in (2, 4)
    ]

    assert old([*day_of(NOW_NS), *begun_anew]) == begun_anew[1:]


def test_a_clock_that_is_behind_makes_less_old():
    files = [*day_of(NOW_NS), file_of(NOW_NS - 4 * DAY_NS)]

    assert len(old(files)) == 1
    assert old(files, NOW_NS - 3 * DAY_NS) == []


def test_each_unit_has_its_own_clock_and_what_has_no_unit_that_of_the_others():
    other, unknown = file_of(NOW_NS - 9 * DAY_NS, unit="U2"), file_of(NOW_NS - 9 * DAY_NS, 0, "")

    assert old([*day_of(NOW_NS), other, unknown]) == [unknown]
    assert old([*day_of(NOW_NS)[1:], other, unknown]) == []
