"""Evidence takes no more space than it may, and what is young stays longest."""

from pathlib import Path

import pytest

from service.evidence.folders import EvidenceLimits, clear_leftovers, make_room, places, removed

NOW_NS = 1_767_225_600_000_000_000
"""2026-01-01."""

KB = b"x" * 1000

OLDEST, OLD, YOUNG, NEWEST = (
    f"{moment}T000000.000Z-UJB-stiffness_x-{number}"
    for number, moment in enumerate(("20251001", "20251101", "20251228", "20251231"), 1)
)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Four bundles of a kilobyte."""
    for name in (OLDEST, OLD, YOUNG, NEWEST):
        folder = tmp_path / "U1" / name
        folder.mkdir(parents=True)
        (folder / "evidence.json").write_bytes(KB)
    return tmp_path


def left(root: Path, soft: int, hard: int, most: int = 200) -> list[str]:
    make_room(root, EvidenceLimits(soft, hard, 30.0, most), NOW_NS)
    return [each.folder.name for each in places(root)]


def test_what_fits_stays(root: Path) -> None:
    assert left(root, 4000, 8000) == [OLDEST, OLD, YOUNG, NEWEST]


def test_the_oldest_goes_first_and_is_remembered(root: Path) -> None:
    assert left(root, 3000, 8000) == [OLD, YOUNG, NEWEST]
    assert removed(root, "U1") == [OLDEST]


def test_what_is_young_stays_until_the_hard_limit(root: Path) -> None:
    assert left(root, 1, 8000) == [YOUNG, NEWEST]
    assert left(root, 1, 1) == [NEWEST]


def test_an_alarm_that_chatters_loses_its_own_oldest(root: Path) -> None:
    other = root / "U1" / "20250101T000000.000Z-LJB-stiffness_x-1"
    other.mkdir()
    assert left(root, 8000, 8000, most=2) == [other.name, YOUNG, NEWEST]


def test_what_is_none_of_ours_is_left_alone(root: Path) -> None:
    notes = root / "U1" / "my notes"
    notes.mkdir()
    clear_leftovers(root)
    left(root, 1, 1)
    assert notes.is_dir()
