"""What goes when there is too much: the oldest first, whatever clocks have said."""

from dataclasses import replace
from typing import Any

from service.recordings.retention import AgeLimit
from service.runtime.disk import DiskSpace
from service.store.waveforms import WaveformFile, WaveformKind

CONTINUOUS, CAPTURE = WaveformKind.CONTINUOUS, WaveformKind.CAPTURE


def size_of(rig: Any) -> int:
    rig.caretaker.look()
    return max(int(file.n_bytes) for file in rig.files())


def test_the_oldest_go_when_all_together_are_too_large(rig: Any) -> None:
    folders = [rig.make(hour) for hour in range(5)]
    rig.limit(continuous_bytes=round(2.5 * size_of(rig)))
    rig.caretaker.look()

    assert rig.names() == [folder.name for folder in folders[3:]]
    assert [file.name for file in rig.files()] == rig.names()
    assert rig.caretaker.found.n_removed == {"continuous": 3}


def test_what_is_too_old_goes_however_much_room_there_is(rig: Any) -> None:
    old = rig.make(0)
    rig.limit(continuous_days=1.0)
    rig.caretaker.look()
    young = rig.make_day(8)
    rig.clock.s = 32 * 3600.0
    rig.caretaker.look()

    assert not old.exists()
    assert rig.names() == young


def test_captures_have_a_limit_of_their_own_and_evidence_stays_longest(rig: Any) -> None:
    names = [rig.make(hour, CAPTURE).name for hour in range(4)]
    continuous = rig.make(0)
    rig.bound = frozenset([names[0], names[2]])
    rig.limit(capture_bytes=round(2.5 * size_of(rig)))
    rig.caretaker.look()
    # the first that nothing refers to, then the oldest; the newest in no case
    assert rig.names(CAPTURE) == names[2:]
    assert continuous.exists()


def test_a_disk_that_is_nearly_full_costs_continuous_recordings_only(rig: Any) -> None:
    captures = [rig.make(hour, CAPTURE).name for hour in range(3)]
    kept = [rig.make(hour).name for hour in range(4)]
    size = size_of(rig)
    total = 1000 * size
    rig.space = DiskSpace(1, total, round(0.11 * total - 1.5 * size))
    rig.caretaker.look()

    assert rig.names() == kept[2:]
    assert rig.names(CAPTURE) == captures
    assert not rig.gauge.is_full


def test_a_full_disk_costs_captures_too_but_no_evidence_and_not_the_newest(rig: Any) -> None:
    captures = [rig.make(hour, CAPTURE).name for hour in range(4)]
    rig.make(0)
    rig.bound = frozenset(captures[:1])
    size_of(rig)
    rig.space = DiskSpace(1, 10**12, 0)
    rig.caretaker.look()

    assert rig.names() == []
    assert rig.names(CAPTURE) == [captures[0], captures[3]]
    assert rig.gauge.is_full


def test_what_cannot_be_read_is_not_the_oldest_for_that(rig: Any) -> None:
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


def test_ages_count_from_where_a_day_of_recordings_begins() -> None:
    newest = day_of(NOW_NS)
    since_ns = NOW_NS - 23 * HOUR_NS - 2 * DAY_NS
    gone, kept = file_of(since_ns - 1), file_of(since_ns)

    assert old([*newest, gone, kept]) == [gone]
    assert old([*newest[1:], gone]) == []  # which is less than a day


def test_a_recording_during_which_a_clock_was_set_is_no_day_of_recordings() -> None:
    across = file_of(NOW_NS + YEAR_NS, YEAR_NS)

    assert old([*day_of(NOW_NS), across], NOW_NS + YEAR_NS) == []


def test_what_a_device_records_in_the_year_2000_is_as_old_as_when_it_was_found() -> None:
    begun_anew = [
        replace(file_of(NOW_NS - 26 * YEAR_NS), changed_ns=NOW_NS - days * DAY_NS)
        for days in (2, 4)
    ]

    assert old([*day_of(NOW_NS), *begun_anew]) == begun_anew[1:]


def test_a_clock_that_is_behind_makes_less_old() -> None:
    files = [*day_of(NOW_NS), file_of(NOW_NS - 4 * DAY_NS)]

    assert len(old(files)) == 1
    assert old(files, NOW_NS - 3 * DAY_NS) == []


def test_each_unit_has_its_own_clock_and_what_has_no_unit_that_of_the_others() -> None:
    other, unknown = file_of(NOW_NS - 9 * DAY_NS, unit="U2"), file_of(NOW_NS - 9 * DAY_NS, 0, "")

    assert old([*day_of(NOW_NS), other, unknown]) == [unknown]
    assert old([*day_of(NOW_NS)[1:], other, unknown]) == []
