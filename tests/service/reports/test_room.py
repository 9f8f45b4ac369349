"""Evidence takes no more space than it may, and what is young stays longest."""

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from service.reports.folders import Place, clear_leftovers, places, removed
from service.reports.retention import SURVEY_S, EvidenceRetention
from service.settings.storage import EvidenceSettings

RoomOf = Callable[..., EvidenceRetention]
KB = b"x" * 1000

OLDEST, OLD, YOUNG, NEWEST = (
    f"{moment}T000000.000Z-UJB-film_stiffness-{number}"
    for number, moment in enumerate(("20251001", "20251101", "20251228", "20251231"), 1)
)
FIFTH = "20251231T120000.000Z-UJB-film_stiffness-5"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Four bundles of a kilobyte."""
    for name in (OLDEST, OLD, YOUNG, NEWEST):
        bundle(tmp_path, name)
    return tmp_path


@pytest.fixture
def room_of(root: Path, stepped_clock: Any) -> RoomOf:
    """Builds what makes room, at the beginning of 2026, by the limits it is given."""

    def build(soft: int, hard: int = 8000, most: int = 200) -> EvidenceRetention:
        limits = EvidenceSettings(max_gb=soft / 1e9, hard_max_gb=hard / 1e9, max_per_alarm=most)
        return EvidenceRetention(root, limits, stepped_clock)

    return build


def bundle(root: Path, name: str, content: bytes = KB) -> Place:
    """A bundle on the disk, as written by hand."""
    folder = root / "U1" / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "evidence.json").write_bytes(content)
    return next(each for each in places(root, "U1") if each.folder == folder)


def left(root: Path) -> list[str]:
    return [each.folder.name for each in places(root)]


def test_the_oldest_goes_first_and_is_remembered(root, room_of):
    assert room_of(4000).make() == []
    assert left(root) == [OLDEST, OLD, YOUNG, NEWEST]
    assert room_of(3000).make() == [OLDEST]
    assert left(root) == [OLD, YOUNG, NEWEST]
    assert removed(root, "U1") == [OLDEST]


@pytest.mark.parametrize(("hard", "kept"), [(8000, [YOUNG, NEWEST]), (1, [NEWEST])])
def test_what_is_young_stays_until_the_hard_limit(root, room_of, hard, kept):
    room_of(1, hard).make()
    assert left(root) == kept


def test_an_alarm_that_chatters_loses_its_own_oldest(root, room_of):
    other = bundle(root, "20250101T000000.000Z-LJB-film_stiffness-1").folder.name
    assert room_of(8000, most=2).make() == [OLDEST, OLD]
    assert left(root) == [other, YOUNG, NEWEST]


@pytest.mark.parametrize("limits", [{"soft": 4000}, {"soft": 8000, "most": 4}])
def test_a_bundle_that_was_written_makes_its_room(root, room_of, limits):
    room = room_of(**limits)
    assert room.make() == []
    room.note(bundle(root, FIFTH))
    assert room.make() == [OLDEST]
    assert room.make() == []


def test_a_bundle_that_has_become_larger_counts_once_with_its_new_size(root, room_of):
    room = room_of(4500)
    room.make()
    room.note(bundle(root, NEWEST, KB + b"x" * 400))
    assert room.make() == []
    room.note(bundle(root, NEWEST, KB + b"x" * 600))
    assert room.make() == [OLDEST]


def test_what_was_taken_away_by_hand_is_found_out_within_an_hour(root, room_of, stepped_clock):
    room = room_of(4000)
    room.make()
    shutil.rmtree(root / "U1" / OLDEST)
    stepped_clock.step(SURVEY_S + 1.0)
    room.note(bundle(root, FIFTH))
    assert room.make() == []


@pytest.mark.parametrize("all_are_gone", [False, True])
def test_what_cannot_be_removed_is_looked_for_again_while_it_is_there(root, room_of, all_are_gone):
    room, in_the_way = room_of(8000, most=3), root / "U1" / (OLDEST + ".incomplete")
    in_the_way.write_bytes(b"not a folder")
    with pytest.raises(OSError, match=OLDEST):
        room.make()
    assert OLDEST in left(root)
    if all_are_gone:
        shutil.rmtree(root / "U1")
    else:
        in_the_way.unlink()
    found = [] if all_are_gone else [OLDEST]
    assert room.make() == found
    assert removed(root, "U1") == found


def test_what_is_none_of_ours_is_left_alone(root, room_of):
    notes = root / "U1" / "my notes"
    notes.mkdir()
    clear_leftovers(root)
    room_of(1, 1).make()
    assert notes.is_dir()


def test_names_of_removed_files_are_not_lost_on_a_full_disk(root, room_of, monkeypatch):
    assert room_of(3000).make() == [OLDEST]
    full = Mock(side_effect=OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        room_of(2000).make()

    assert removed(root, "U1") == [OLDEST]
    assert left(root) == [OLD, YOUNG, NEWEST]
