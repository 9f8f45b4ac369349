"""A kill at any moment costs no more than the part that was being written."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from rigs.capturing import BLOCK, counted_block, numbers, samples

from acquisition.recordings.manifest import RecordedUnit
from acquisition.recordings.reader import Recording, open_recording
from core.samples.blocks import SampleBlock
from service.recordings.continuous_recorder import UnitRecorder, last_end
from service.recordings.folders import remove_incomplete
from service.recordings.segment import SegmentSettings, join, unjoined

SETTINGS = SegmentSettings(segment_s=4.0, part_s=2.0)
N_BLOCKS = 30
DEEDS = ("mkdir", "rename", "unlink", "rmdir")


class Killed(BaseException):
    """The process ends here."""


@contextmanager
def killed_at(deed: int, patch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """End the process instead of the n-th thing that is done to a folder."""
    done: list[str] = []

    def counted(name: str) -> Callable[..., Any]:
        original = getattr(Path, name)

        def do(path: Path, *how: Any, **more: Any) -> Any:
            if len(done) == deed:
                raise Killed
            done.append(name)
            return original(path, *how, **more)

        return do

    with patch.context() as inner:
        for name in DEEDS:
            inner.setattr(Path, name, counted(name))
        yield done


def recover(root: Path) -> None:
    left = unjoined(root, ("U1",))
    remove_incomplete(root, ("U1",))
    for folder in left:
        join(folder)


def record(root: Path, unit: RecordedUnit, blocks: list[SampleBlock], synced: list[int]) -> None:
    """Record as the service does, and note up to where samples were on the disk."""
    tape = UnitRecorder(root, unit, SETTINGS, last_end(root, unit.unit))
    for each in blocks:
        tape.write(each, 0.0)
        synced[0] = max(synced[0], tape.n_written)
        for folder in tape.ended:
            join(folder)
        tape.ended.clear()
    tape.end()
    for folder in tape.ended:
        join(folder)


def account(recordings: list[Recording]) -> tuple[list[int], int]:
    """Numbers of the samples, and how many are told to be missing."""
    found = [number for each in recordings for number in samples(each)]
    summaries = [recording.summary for recording in recordings]
    missing = sum(s.n_gap_samples + sum(s.rejected.values()) for s in summaries)
    return found, missing


def recordings_in(root: Path) -> list[Recording]:
    return [open_recording(folder) for folder in sorted(root.iterdir())]


def test_a_kill_at_any_moment_loses_nothing_synced_and_tells_the_hole(root, unit, monkeypatch):
    blocks = [counted_block(n) for n in range(N_BLOCKS)]
    later = [counted_block(n) for n in range(N_BLOCKS + 5, N_BLOCKS + 15)]
    root.mkdir()
    with killed_at(10**9, monkeypatch) as done:
        record(root / "whole", unit, blocks, [0])
    assert len(done) > 25
    for deed in range(len(done)):
        place, synced = root / f"{deed}", [0]
        with killed_at(deed, monkeypatch), pytest.raises(Killed):
            record(place, unit, blocks, synced)
        recover(place)
        record(place, unit, later, [0])
        found, missing = account(recordings_in(place))
        assert found == sorted(set(found)), f"killed at {deed}: twice"
        assert found[: synced[0]] == list(range(synced[0])), f"killed at {deed}: lost"
        n_before = len(found) - len(later) * BLOCK
        assert n_before >= synced[0]
        told = (N_BLOCKS + 15) * BLOCK if n_before else len(later) * BLOCK
        assert len(found) + missing == told, f"killed at {deed}: not accounted for"


def test_a_kill_during_recovery_changes_nothing(root, unit, monkeypatch):
    blocks = [counted_block(n) for n in range(15)]

    def crashed(place: Path) -> None:
        tape = UnitRecorder(place, unit, SETTINGS)
        for each in blocks:
            tape.write(each, 0.0)

    crashed(root / "whole")
    with killed_at(10**9, monkeypatch) as done:
        recover(root / "whole")
    for deed in range(len(done)):
        place = root / f"{deed}"
        crashed(place)
        with killed_at(deed, monkeypatch), pytest.raises(Killed):
            recover(place)
        recover(place)

        assert account(recordings_in(place)) == (numbers(0, 10), 0), f"killed at {deed}"
