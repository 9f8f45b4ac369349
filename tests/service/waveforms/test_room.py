"""What goes when there is too much: the oldest first, evidence of alarms last."""

from typing import Any

from service.space.disk import DiskSpace
from service.store.waveform_port import WaveformKind

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
