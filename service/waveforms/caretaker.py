"""`Caretaker`: looks through the folders of recordings, in the thread of the keeper."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import structlog

from acquisition.clock import Clock
from core.units import NS_PER_S
from service.space.disk import Measure
from service.space.limits import SpaceLimits
from service.store.waveform_port import WaveformFile, WaveformKind, WaveformState
from service.waveforms.folders import (
    being_removed,
    finished,
    is_recording,
    put_out_of_sight,
    set_aside,
    take_away,
)
from service.waveforms.index import Index
from service.waveforms.inspection import again, inspected
from service.waveforms.room import Bound, Need, RoomLimits, to_remove

log = structlog.get_logger()

MAX_LOOK_S = 2.0
"""Longest that new recordings are read in one look; the others come next time."""

CHECK_SHARE = 0.02
"""Share of the time that goes into reading recordings once more."""

DAY_NS = 86_400 * NS_PER_S
CHECK_EVERY_NS = DAY_NS
REMEMBERED_NS = 90 * DAY_NS
"""How long entries stay of what is gone."""


@dataclass
class Findings:
    """What was found and done since the start."""

    n_adopted: int = 0
    n_damaged: int = 0
    n_missing: int = 0
    n_checked: int = 0
    n_removed: Counter[str] = field(default_factory=Counter)
    """By kind."""


@dataclass(frozen=True)
class Custody:
    """What a caretaker looks after, and by which rules.

    Parameters
    ----------
    roots
        Folder of each kind of recordings.
    bound
        Captures that evidence refers to.
    """

    roots: Mapping[WaveformKind, Path]
    room: RoomLimits
    space: SpaceLimits
    bound: Bound
    measure: Measure


class Caretaker:
    """Brings index and folders together; the folders are what counts.

    Attributes
    ----------
    is_full
        Whether so little room is left on the disk that nothing more is to be recorded.
    """

    def __init__(self, custody: Custody, index: Index, clock: Clock) -> None:
        self._custody, self._index, self._clock = custody, index, clock
        self._check_from_s = self._forgot_s = -1.0
        self.found = Findings()
        self.is_full = False

    @property
    def on_disk(self) -> Sequence[WaveformFile]:
        """Recordings that are there, damaged or not."""
        return self._index.on_disk

    @property
    def faults(self) -> Mapping[str, str]:
        """Why each damaged recording is none to be served, by name."""
        return self._index.faults

    def look(self) -> None:
        """Look once.

        Raises
        ------
        OSError
            If a disk refuses.
        StoreError
            If the index cannot be written.
        """
        until_s = self._clock.monotonic_s() + MAX_LOOK_S
        for kind, root in self._custody.roots.items():
            self._finish_removals(kind, root)
            self._survey(kind, root, until_s)
        self._make_room()
        self._check_one()
        self._forget()

    def _finish_removals(self, kind: WaveformKind, root: Path) -> None:
        for name in being_removed(root):
            known = self._index.get(kind, name)
            if known is not None and not (root / name).exists():
                self._note_removed(known, "its removal was interrupted")
            take_away(root / name)

    def _survey(self, kind: WaveformKind, root: Path, until_s: float) -> None:
        known, there = self._index.names(kind), set(finished(root))
        if known and not root.is_dir():
            raise OSError(f"{root}: the folder of {len(known)} recordings is not there")
        lost = [file for name in known - there if (file := self._index.get(kind, name))]
        if lost:
            self.found.n_missing += len(lost)
            log.error("recordings are missing", names=[file.name for file in lost[:10]])
            now_ns = self._clock.now_ns()
            self._index.mark(lost, WaveformState.MISSING, "it is not in its folder", now_ns)
        for name in sorted(there - known):
            if self._clock.monotonic_s() > until_s:
                return
            if is_recording(root / name):
                self._adopt(kind, root / name)

    def _adopt(self, kind: WaveformKind, folder: Path) -> None:
        file = inspected(folder, self._index.place, kind, self._clock.now_ns())
        if file.state is WaveformState.DAMAGED:
            file = replace(file, name=set_aside(folder).name)
            self._tell_damaged(file)
        else:
            self.found.n_adopted += 1
        self._index.put([file])

    def _make_room(self) -> None:
        files, need = self._index.on_disk, self._need()
        now_ns, rules = self._clock.now_ns(), self._custody
        for file, reason in to_remove(files, rules.room, now_ns, need, rules.bound):
            folder = rules.roots[file.kind] / file.name
            put_out_of_sight(folder)
            self._note_removed(file, reason)
            take_away(folder)

    def _need(self) -> Need:
        """What is short on each disk; nothing is removed for the sake of another one."""
        soft = hard = 0
        for kind, root in self._custody.roots.items():
            space = self._custody.measure(root)
            limits = self._custody.space.of(space.total_bytes)
            # more than the alarm needs, so that recordings never raise it
            alert = (limits.alert_below or 0.0) + limits.deadband
            danger = limits.danger_below or 0.0
            if kind is WaveformKind.CONTINUOUS:
                soft = round(alert * space.total_bytes) - space.free_bytes
                self.is_full = space.free_share < danger
            else:
                hard = round(danger * space.total_bytes) - space.free_bytes
        return Need(max(soft, 0), max(hard, 0))

    def _note_removed(self, file: WaveformFile, reason: str) -> None:
        self.found.n_removed[file.kind.value] += 1
        log.info("a recording is removed", name=file.name, reason=reason)
        self._index.mark([file], WaveformState.REMOVED, reason, self._clock.now_ns())

    def _check_one(self) -> None:
        """Read what was not read for the longest time, in a small share of all time."""
        start_s, file = self._clock.monotonic_s(), self._index.longest_unchecked()
        if file is None or start_s < self._check_from_s:
            return
        if self._clock.now_ns() - file.checked_ns < CHECK_EVERY_NS:
            return
        self.check(file)
        took_s = self._clock.monotonic_s() - start_s
        self._check_from_s = start_s + took_s / CHECK_SHARE

    def check(self, file: WaveformFile) -> WaveformFile:
        """Read all of a recording once more, and note what it is found to be."""
        folder = self._custody.roots[file.kind] / file.name
        found = again(file, folder, self._clock.now_ns())
        self.found.n_checked += 1
        if found.state is WaveformState.DAMAGED:
            self._tell_damaged(found)
        self._index.put([found])
        return found

    def _tell_damaged(self, file: WaveformFile) -> None:
        self.found.n_damaged += 1
        log.error("a recording is damaged", name=file.name, reason=file.reason)

    def _forget(self) -> None:
        now_s = self._clock.monotonic_s()
        if self._forgot_s < 0.0 or now_s - self._forgot_s > DAY_NS / NS_PER_S:
            self._forgot_s = now_s
            self._index.forget(self._clock.now_ns() - REMEMBERED_NS)
