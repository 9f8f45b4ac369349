"""`Caretaker`: looks through the folders of recordings, in the thread of the keeper."""

import errno
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import structlog

from acquisition.clock import Clock
from core.units import DAY_NS, NS_PER_S
from service.recordings.folders import (
    being_removed,
    empty,
    finish_removal,
    finished,
    is_recording,
    put_out_of_sight,
    set_aside,
)
from service.recordings.index import Index, Unread, again, inspected
from service.recordings.keeping.gauge import Gauge
from service.recordings.keeping.room import Bound, RoomLimits, make_room
from service.recordings.keeping.troubles import Troubles
from service.store.waveform_port import WaveformFile, WaveformKind, WaveformState

log = structlog.get_logger()

MAX_LOOK_S = 2.0
"""Longest that new recordings are read in one look; the others come next time."""

CHECK_SHARE = 0.02
"""Share of the time that goes into reading recordings once more."""

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
    gauge: Gauge
    bound: Bound


class Caretaker:
    """Brings index and folders together; the folders are what counts.

    Whatever fails, the rest is done: above all room is made while nothing can be written any more.
    """

    def __init__(self, custody: Custody, index: Index, clock: Clock) -> None:
        self._custody, self._index, self._clock = custody, index, clock
        self._check_from_s = self._forgot_s = -1.0
        self._unread = Unread(clock)
        self.found = Findings()

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
        troubles = Troubles()
        for kind, root in self._custody.roots.items():
            with troubles.borne():
                self._go_on_removing(kind, root, troubles)
            with troubles.borne():
                self._survey(kind, root, until_s)
        with troubles.borne():
            self._make_room(troubles)
        with troubles.borne():
            self._finish_removals(troubles)
        with troubles.borne():
            self._check_one()
        with troubles.borne():
            self._forget()
        with troubles.borne():
            self._unread.tell()
        troubles.tell()

    def _go_on_removing(self, kind: WaveformKind, root: Path, troubles: Troubles) -> None:
        for name in being_removed(root):
            known = self._index.get(kind, name)
            if known is not None and not (root / name).exists():
                self._note_removed(known, "its removal was interrupted")
            with troubles.borne():
                empty(root / name)

    def _survey(self, kind: WaveformKind, root: Path, until_s: float) -> None:
        known, there = self._index.names(kind), set(finished(root))
        if known and not root.is_dir():
            raise OSError(f"{root}: the folder of {len(known)} recordings is not there")
        self._unread.keep(kind, there)
        lost = [file for name in known - there if (file := self._index.get(kind, name))]
        if lost:
            now_ns = self._clock.now_ns()
            self._index.mark(lost, WaveformState.MISSING, "it is not in its folder", now_ns)
            self.found.n_missing += len(lost)
            log.error("recordings are missing", names=[file.name for file in lost[:10]])
        for name in sorted(there - known):
            if self._clock.monotonic_s() > until_s:
                return
            if self._unread.is_due(kind, name):
                with self._unread.noted(kind, name):
                    self._adopt(kind, root / name)

    def _adopt(self, kind: WaveformKind, folder: Path) -> None:
        if not is_recording(folder):
            return
        file = inspected(folder, self._index.place, kind, self._clock.now_ns())
        if file.state is WaveformState.DAMAGED:
            file = replace(file, name=set_aside(folder).name)
        self._index.put([file])
        if file.state is WaveformState.DAMAGED:
            self._tell_damaged(file)
        else:
            self.found.n_adopted += 1

    def _make_room(self, troubles: Troubles) -> None:
        rules = self._custody
        with troubles.borne():
            rules.gauge.measure()

        def remove(file: WaveformFile, reason: str) -> bool:
            folder = rules.roots[file.kind] / file.name
            with troubles.borne():
                put_out_of_sight(folder)
                self._note_removed(file, reason)
                empty(folder)
                return True
            return False

        need, now_ns = rules.gauge.need, self._clock.now_ns()
        make_room(self._index.on_disk, rules.room, now_ns, need, rules.bound, remove)

    def _note_removed(self, file: WaveformFile, reason: str) -> None:
        self.found.n_removed[file.kind.value] += 1
        log.info("a recording is removed", name=file.name, reason=reason)
        self._index.remove(file, reason, self._clock.now_ns())

    def _finish_removals(self, troubles: Troubles) -> None:
        """Remove the folders of what the index knows to be gone.

        As long as it cannot be told, an empty folder says so to the next start.
        """
        self._index.settle()
        for root in self._custody.roots.values():
            with troubles.borne():
                for name in being_removed(root):
                    with troubles.borne():
                        left = finish_removal(root / name)
                        if left is not None:
                            words = "a removed recording leaves a folder with files of others"
                            log.warning(words, folder=left.name)

    def _check_one(self) -> None:
        """Read what was not read for the longest time, in a small share of all time."""
        start_s = self._clock.monotonic_s()
        due = (f for f in self._index.whole if self._unread.is_due(f.kind, f.name))
        file = min(due, key=lambda file: file.checked_ns, default=None)
        if file is None or start_s < self._check_from_s:
            return
        if self._clock.now_ns() - file.checked_ns < CHECK_EVERY_NS:
            return
        with self._unread.noted(file.kind, file.name):
            self.check(file)
        took_s = self._clock.monotonic_s() - start_s
        self._check_from_s = start_s + took_s / CHECK_SHARE

    def check(self, file: WaveformFile) -> WaveformFile:
        """Read all of a recording once more, and note what it is found to be.

        Raises
        ------
        OSError
            If the disk refuses, or all of them are away: that says nothing of the recording.
        StoreError
            If it cannot be noted.
        """
        folder = self._custody.roots[file.kind] / file.name
        if not folder.is_dir():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(folder))
        found = again(file, folder, self._clock.now_ns())
        self.found.n_checked += 1
        self._index.put([found])
        if found.state is WaveformState.DAMAGED:
            self._tell_damaged(found)
        return found

    def _tell_damaged(self, file: WaveformFile) -> None:
        self.found.n_damaged += 1
        log.error("a recording is damaged", name=file.name, reason=file.reason)

    def _forget(self) -> None:
        now_s = self._clock.monotonic_s()
        if self._forgot_s < 0.0 or now_s - self._forgot_s > DAY_NS / NS_PER_S:
            self._index.forget(self._clock.now_ns() - REMEMBERED_NS)
            self._forgot_s = now_s
