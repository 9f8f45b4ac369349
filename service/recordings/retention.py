"""How long recordings stay: age, room, order of removal."""

import errno
import os
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import structlog

from acquisition.clock import Clock
from core.units import DAY_NS, NS_PER_S, ns_from_s
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
from service.runtime.disk import Measure, SpaceLimits
from service.store.port import StoreError
from service.store.waveforms import WaveformFile, WaveformKind, WaveformState

BELIEVED_NS = 86_400 * NS_PER_S
"""How much has to be recorded by a clock before anything is old by it."""

LONGEST_NS = 3600 * NS_PER_S
"""No recording is longer by the settings: what its stamps say beyond that is a clock that was
set."""


class NotOldFrom:
    """Knows for each unit which of its recordings are too old.

    Parameters
    ----------
    files
        All continuous recordings.
    keep_ns
        For how long they are kept.
    """

    def __init__(self, files: Iterable[WaveformFile], now_ns: int, keep_ns: int) -> None:
        by_unit: defaultdict[str, list[WaveformFile]] = defaultdict(list)
        for file in files:
            by_unit[file.unit].append(file)
        believed = {unit: _believed_ns(of_unit) for unit, of_unit in by_unit.items()}
        self._since_ns = {
            unit: min(now_ns, moment) - keep_ns
            for unit, moment in believed.items()
            if moment is not None
        }
        # whose unit cannot be read was found by the same clock as all others
        self._since_of_others_ns = max(self._since_ns.values(), default=None)

    def is_old(self, file: WaveformFile) -> bool:
        """Whether it has been kept for long enough."""
        since_ns = self._since_ns.get(file.unit)
        if not file.unit:
            since_ns = self._since_of_others_ns
        return since_ns is not None and _time_ns(file) < since_ns


def _believed_ns(files: Iterable[WaveformFile]) -> int | None:
    """The newest time that a day of recordings is newer than; None if there are not so many."""
    n_recorded_ns = 0
    for file in sorted(files, key=_time_ns, reverse=True):
        n_recorded_ns += min(max(file.stop_ns - file.start_ns, 0), LONGEST_NS)
        if n_recorded_ns >= BELIEVED_NS:
            return _time_ns(file)
    return None


def _time_ns(file: WaveformFile) -> int:
    return max(file.stop_ns, file.changed_ns)


S_PER_DAY = 86_400.0


@dataclass(frozen=True)
class RoomLimits:
    """How much recordings may take.

    Parameters
    ----------
    continuous_bytes, capture_bytes
        Of all of a kind together.
    continuous_days
        Continuous recordings go that are older than this; see `service.recordings.keeping.ages`.
    """

    continuous_bytes: int = 100_000_000_000
    capture_bytes: int = 10_000_000_000
    continuous_days: float = 30.0


@dataclass(frozen=True)
class Need:
    """How much room has to be made on the disk.

    Parameters
    ----------
    soft_bytes
        By continuous recordings.
    hard_bytes
        By captures as well, if they are not part of any evidence.
    """

    soft_bytes: int = 0
    hard_bytes: int = 0


Bound = Callable[[], frozenset[str]]
"""Names of captures that evidence of an alarm refers to; asked only when captures have to go."""

Remove = Callable[[WaveformFile, str], bool]
"""Removes a recording and says why; whether it is gone. The next one goes in place of one that
is not."""


def make_room(
    files: Iterable[WaveformFile],
    limits: RoomLimits,
    now_ns: int,
    need: Need,
    bound: Bound,
    remove: Remove,
) -> None:
    """Have removed what has to go, in this order.

    Raises
    ------
    OSError
        If it cannot be found out what evidence refers to; continuous recordings have gone then.
    """
    by_age = sorted(files, key=lambda file: (_stop_ns(file), file.name))
    continuous = [file for file in by_age if file.kind is WaveformKind.CONTINUOUS]
    captures = [file for file in by_age if file.kind is WaveformKind.CAPTURE]
    n_freed = _continuous(continuous, limits, now_ns, need.soft_bytes, remove)
    over = sum(file.n_bytes for file in captures) - limits.capture_bytes
    short = need.hard_bytes - n_freed
    if over > 0 or short > 0:
        _captures(captures, over, short, bound(), remove)


def _continuous(
    by_age: Sequence[WaveformFile], limits: RoomLimits, now_ns: int, short: int, remove: Remove
) -> int:
    """Remove continuous ones; how many bytes became free."""
    over = sum(file.n_bytes for file in by_age) - limits.continuous_bytes
    not_old = NotOldFrom(by_age, now_ns, ns_from_s(limits.continuous_days * S_PER_DAY))
    n_freed = 0
    for file in by_age:
        if over > n_freed:
            why = "all together are over max_gb"
        elif short > n_freed:
            why = "the disk is nearly full"
        elif not_old.is_old(file):
            why = "it is older than max_days"
        else:
            continue
        n_freed += file.n_bytes if remove(file, why) else 0
    return n_freed


def _captures(
    by_age: Sequence[WaveformFile], over: int, short: int, bound: frozenset[str], remove: Remove
) -> None:
    """The newest stays in any case; what evidence refers to goes last, and never for the disk."""
    older = by_age[:-1]
    for file in sorted(older, key=lambda file: file.name in bound):
        if over > 0:
            why = "all captures together are over max_gb"
        elif short > 0 and file.name not in bound:
            why = "the disk is nearly full"
        else:
            return
        if remove(file, why):
            over, short = over - file.n_bytes, short - file.n_bytes


def _stop_ns(file: WaveformFile) -> int:
    """When it ended, or when it was found if that cannot be read."""
    return file.stop_ns or file.changed_ns


class Troubles:
    """Remembers the first thing that went wrong while the rest was done all the same.

    Attributes
    ----------
    first
        What went wrong first; None as long as nothing did.
    """

    def __init__(self) -> None:
        self.first: OSError | StoreError | None = None

    @contextmanager
    def borne(self) -> Iterator[None]:
        """Let a disk or the store refuse in here."""
        try:
            yield
        except (OSError, StoreError) as error:
            self.first = self.first or error

    def tell(self) -> None:
        """Raise what went wrong first, if anything did.

        Raises
        ------
        OSError
            If it was a disk.
        StoreError
            If it was the index.
        """
        if self.first is not None:
            raise self.first


class Gauge:
    """Measures the disks that recordings are on.

    Parameters
    ----------
    roots
        Folder of each kind of recordings.

    Attributes
    ----------
    is_full
        Whether so little room is left on the disk that nothing more is to be recorded.
    need
        What is short on each disk; nothing is removed for the sake of another one.
    """

    def __init__(
        self, roots: Mapping[WaveformKind, Path], space: SpaceLimits, measure: Measure
    ) -> None:
        self._roots, self._space, self._measure = roots, space, measure
        self.is_full = False
        self.need = Need()

    def measure(self) -> None:
        """Measure all of them; one that does not say is short of nothing.

        Raises
        ------
        OSError
            If a disk does not say.
        """
        short = dict.fromkeys(WaveformKind, 0)
        troubles = Troubles()
        for kind, root in self._roots.items():
            with troubles.borne():
                short[kind] = self._short(kind, root)
        self.need = Need(short[WaveformKind.CONTINUOUS], short[WaveformKind.CAPTURE])
        troubles.tell()

    def _short(self, kind: WaveformKind, root: Path) -> int:
        space = self._measure(root)
        limits = self._space.of(space.total_bytes)
        danger = limits.danger_below or 0.0
        least = danger
        if kind is WaveformKind.CONTINUOUS:
            self.is_full = space.free_share < danger
            # more than the alarm needs, so that recordings never raise it
            least = (limits.alert_below or 0.0) + limits.deadband
        return max(round(least * space.total_bytes) - space.free_bytes, 0)


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
