"""Retention of recordings: removal by age and disk space, and periodic checks for damage."""

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
    begin_removal,
    being_removed,
    delete_files,
    finish_removal,
    finished,
    is_recording,
    set_aside,
)
from service.recordings.index import Index, RetryList, inspected, reinspected
from service.runtime.disk import S_PER_DAY, Measure
from service.settings.storage import SpaceSettings
from service.store.port import StoreError
from service.store.waveforms import WaveformFile, WaveformKind, WaveformState

TRUSTED_NS = DAY_NS
"""Total duration of recordings, ns, that confirms that the clock of the unit is correct."""

MAX_LENGTH_NS = 3600 * NS_PER_S
"""Maximum duration of a recording, ns; a longer duration indicates a step of the clock."""


class AgeLimit:
    """Maximum age, `keep_ns`, of the continuous recordings `files`, by the clock of each unit.

    The age is counted back from the start of the newest day of recordings, or from now if that is
    earlier, so that a forward step of the clock does not make all recordings too old.
    """

    def __init__(self, files: Iterable[WaveformFile], now_ns: int, keep_ns: int) -> None:
        by_unit: defaultdict[str, list[WaveformFile]] = defaultdict(list)
        for file in files:
            by_unit[file.unit].append(file)
        self._since_ns = {
            unit: min(now_ns, trusted_ns) - keep_ns
            for unit, of_unit in by_unit.items()
            if (trusted_ns := _trusted_ns(of_unit)) is not None
        }
        # recordings with an unreadable unit have times by the same clock as the others
        self._newest_ns = max(self._since_ns.values(), default=None)

    def is_old(self, file: WaveformFile) -> bool:
        """Return whether a recording is too old; False if its unit has less than a day of them."""
        since_ns = self._since_ns.get(file.unit) if file.unit else self._newest_ns
        return since_ns is not None and _time_ns(file) < since_ns


def _trusted_ns(files: Iterable[WaveformFile]) -> int | None:
    """Return the time after which `TRUSTED_NS` of recordings were made; None if there are fewer."""
    n_recorded_ns = 0
    for file in sorted(files, key=_time_ns, reverse=True):
        n_recorded_ns += min(max(file.stop_ns - file.start_ns, 0), MAX_LENGTH_NS)
        if n_recorded_ns >= TRUSTED_NS:
            return _time_ns(file)
    return None


def _time_ns(file: WaveformFile) -> int:
    return max(file.stop_ns, file.changed_ns)


InUse = Callable[[], frozenset[str]]
"""Function that returns the names of the captures to which the evidence of alarms refers."""

Remove = Callable[[WaveformFile, str], bool]
"""Function (recording, reason) that removes a recording and returns whether this succeeded."""


@dataclass(frozen=True)
class RetentionRules:
    """Folder of each kind of recordings, free space on their disks, limits of size and age.

    `in_use` returns the names of the captures to which the evidence of alarms refers. Captures, the
    recordings around alarms, have no limit of age.
    """

    roots: Mapping[WaveformKind, Path]
    gauge: "SpaceGauge"
    in_use: InUse
    continuous_bytes: int = 100_000_000_000
    capture_bytes: int = 10_000_000_000
    continuous_days: float = 30.0


def _make_room(
    files: Iterable[WaveformFile], rules: RetentionRules, now_ns: int, remove: Remove
) -> None:
    """Remove the oldest recordings until the limits are met, continuous recordings first.

    To free disk space, captures are removed only if the removal of continuous recordings frees too
    little, and never if evidence refers to the captures. `remove` removes a recording for a reason
    and returns whether it succeeded.

    Raises
    ------
    OSError
        If the captures in use cannot be determined; only continuous recordings are then removed.
    """
    by_age = sorted(files, key=lambda file: (file.stop_ns or file.changed_ns, file.name))
    continuous = [file for file in by_age if file.kind is WaveformKind.CONTINUOUS]
    captures = [file for file in by_age if file.kind is WaveformKind.CAPTURE]
    over = sum(file.n_bytes for file in continuous) - rules.continuous_bytes
    age_limit = AgeLimit(continuous, now_ns, ns_from_s(rules.continuous_days * S_PER_DAY))
    n_freed, short_bytes = 0, rules.gauge.short_bytes
    for file in continuous:
        if over > n_freed:
            why = "continuous recordings exceed max_gb"
        elif short_bytes[WaveformKind.CONTINUOUS] > n_freed:
            why = "the disk is nearly full"
        elif age_limit.is_old(file):
            why = "the recording is older than max_days"
        else:
            continue
        n_freed += file.n_bytes if remove(file, why) else 0
    over = sum(file.n_bytes for file in captures) - rules.capture_bytes
    short = short_bytes[WaveformKind.CAPTURE] - n_freed
    if over > 0 or short > 0:
        _remove_captures(captures, over, short, rules.in_use(), remove)


def _remove_captures(
    by_age: Sequence[WaveformFile], over: int, short: int, in_use: frozenset[str], remove: Remove
) -> None:
    """Remove captures but never the newest; captures in use last, only for the size limit."""
    for file in sorted(by_age[:-1], key=lambda file: file.name in in_use):
        if over > 0:
            why = "captures exceed max_gb"
        elif short > 0 and file.name not in in_use:
            why = "the disk is nearly full"
        else:
            return
        if remove(file, why):
            over, short = over - file.n_bytes, short - file.n_bytes


class FirstError:
    """First error of several steps that all run, even if one of them fails."""

    def __init__(self) -> None:
        self.first: OSError | StoreError | None = None

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """Return a context manager that catches `OSError` and `StoreError` and keeps the first."""
        try:
            yield
        except (OSError, StoreError) as error:
            self.first = self.first or error

    def raise_first(self) -> None:
        """Raise the first error; do nothing if no error was caught."""
        if self.first is not None:
            raise self.first


class SpaceGauge:
    """Measurement of the free disk space for recordings.

    Parameters
    ----------
    roots
        Folder of each kind of recordings.
    measure
        Function that measures the total and free space of the disk of a folder.

    Attributes
    ----------
    is_full
        Whether too little space is left for continuous recording.
    short_bytes
        Disk space to free, in bytes, by kind of recordings.
    """

    def __init__(
        self, roots: Mapping[WaveformKind, Path], space: SpaceSettings, measure: Measure
    ) -> None:
        self._roots, self._space, self._measure = roots, space, measure
        self.is_full = False
        self.short_bytes = dict.fromkeys(WaveformKind, 0)

    def measure(self) -> None:
        """Update `is_full` and `short_bytes` for all disks; the latter is 0 for an unreadable disk.

        Raises `OSError` if a disk cannot be measured.
        """
        short, errors = dict.fromkeys(WaveformKind, 0), FirstError()
        for kind, root in self._roots.items():
            with errors.deferred():
                space = self._measure(root)
                limits = self._space.limits(space.total_bytes)
                wanted = limits.danger_below or 0.0
                if kind is WaveformKind.CONTINUOUS:
                    self.is_full = space.free_share < wanted
                    # more than the disk alarm requires, so that recordings do not raise it
                    wanted = (limits.alert_below or 0.0) + limits.deadband
                short[kind] = max(round(wanted * space.total_bytes) - space.free_bytes, 0)
        self.short_bytes = short
        errors.raise_first()


log = structlog.get_logger()

MAX_LOOK_S = 2.0
"""Maximum time in seconds for indexing in one run; the next run indexes the others."""

CHECK_SHARE = 0.02
"""Maximum fraction of time in which indexed recordings are checked."""

CHECK_EVERY_NS = DAY_NS

REMEMBERED_NS = 90 * DAY_NS
"""Retention time of the index entries of removed and missing recordings, ns."""


@dataclass
class RetentionCounts:
    """Numbers of recordings indexed, damaged, missing, checked and removed since the start."""

    n_adopted: int = 0
    n_damaged: int = 0
    n_missing: int = 0
    n_checked: int = 0
    n_removed: Counter[str] = field(default_factory=Counter)
    """Number of removed recordings by kind."""


class RecordingRetention:
    """Maintenance of recordings: updates the index from the folders, checks and removes recordings.

    Each step runs even if other steps fail; for example, space is freed even if the index cannot be
    written.
    """

    def __init__(self, rules: RetentionRules, index: Index, clock: Clock) -> None:
        self._rules, self._index, self._clock = rules, index, clock
        self._check_from_s = self._forgot_s = -1.0
        self._retry = RetryList(clock)
        self.found = RetentionCounts()

    @property
    def on_disk(self) -> Sequence[WaveformFile]:
        """Index entries of the recordings on the disk, including damaged recordings."""
        return self._index.on_disk

    @property
    def faults(self) -> Mapping[str, str]:
        """Fault of each damaged recording, by name."""
        return self._index.faults

    def look(self) -> None:
        """Update the index, free disk space, and check one recording if a check is due.

        Raises
        ------
        OSError
            If a disk cannot be read or written.
        StoreError
            If the index cannot be written.
        """
        until_s, errors = self._clock.monotonic_s() + MAX_LOOK_S, FirstError()
        for kind, root in self._rules.roots.items():
            with errors.deferred():
                self._resume_removals(kind, root, errors)
            with errors.deferred():
                self._survey(kind, root, until_s)
        with errors.deferred():
            self._make_room(errors)
        with errors.deferred():
            self._finish_removals(errors)
        for step in (self._check_one, self._forget, self._retry.raise_first):
            with errors.deferred():
                step()
        errors.raise_first()

    def _resume_removals(self, kind: WaveformKind, root: Path, errors: FirstError) -> None:
        for name in being_removed(root):
            known = self._index.get(kind, name)
            if known is not None and not (root / name).exists():
                self._note_removed(known, "the removal was interrupted")
            with errors.deferred():
                delete_files(root / name)

    def _survey(self, kind: WaveformKind, root: Path, until_s: float) -> None:
        known, there = self._index.names(kind), set(finished(root))
        if known and not root.is_dir():
            n = len(known)
            why = f"the folder of recordings ({n} in the index) is missing; mount or restore it"
            raise OSError(f"{root}: {why}")
        self._retry.keep(kind, there)
        missing = [file for name in known - there if (file := self._index.get(kind, name))]
        if missing:
            state, now_ns = WaveformState.MISSING, self._clock.now_ns()
            reason = "the recording is not in the folder"
            self._index.put(
                replace(file, state=state, reason=reason, changed_ns=now_ns) for file in missing
            )
            self.found.n_missing += len(missing)
            log.error("recordings are missing", names=[file.name for file in missing[:10]])
        for name in sorted(there - known):
            if self._clock.monotonic_s() > until_s:
                return
            if self._retry.is_due(kind, name):
                with self._retry.noted(kind, name):
                    self._adopt(kind, root / name)

    def _adopt(self, kind: WaveformKind, folder: Path) -> None:
        if not is_recording(folder):
            return
        file = inspected(folder, self._index.place, kind, self._clock.now_ns())
        if file.state is WaveformState.DAMAGED:
            file = replace(file, name=set_aside(folder).name)
        self._index.put([file])
        if file.state is WaveformState.DAMAGED:
            self._note_damaged(file)
        else:
            self.found.n_adopted += 1

    def _make_room(self, errors: FirstError) -> None:
        rules = self._rules
        with errors.deferred():
            rules.gauge.measure()

        def remove(file: WaveformFile, reason: str) -> bool:
            folder = rules.roots[file.kind] / file.name
            with errors.deferred():
                begin_removal(folder)
                self._note_removed(file, reason)
                delete_files(folder)
                return True
            return False

        _make_room(self._index.on_disk, rules, self._clock.now_ns(), remove)

    def _note_removed(self, file: WaveformFile, reason: str) -> None:
        self.found.n_removed[file.kind.value] += 1
        log.info("recording removed", name=file.name, reason=reason)
        self._index.remove(file, reason, self._clock.now_ns())

    def _finish_removals(self, errors: FirstError) -> None:
        """Remove the folders of removed recordings.

        The folder of a recording is kept until the store has recorded the removal.
        """
        self._index.store_removals()
        for root in self._rules.roots.values():
            with errors.deferred():
                for name in being_removed(root):
                    with errors.deferred():
                        left = finish_removal(root / name)
                        if left is not None:
                            words = "the folder of a removed recording is kept: it has other files"
                            log.warning(words, folder=left.name)

    def _check_one(self) -> None:
        """Check the recording with the oldest check, if due and if `CHECK_SHARE` permits it."""
        start_s = self._clock.monotonic_s()
        due = (f for f in self._index.whole if self._retry.is_due(f.kind, f.name))
        file = min(due, key=lambda file: file.checked_ns, default=None)
        if file is None or start_s < self._check_from_s:
            return
        if self._clock.now_ns() - file.checked_ns < CHECK_EVERY_NS:
            return
        with self._retry.noted(file.kind, file.name):
            self.check(file)
        taken_s = self._clock.monotonic_s() - start_s
        self._check_from_s = start_s + taken_s / CHECK_SHARE

    def check(self, file: WaveformFile) -> WaveformFile:
        """Read a whole recording again, and write and return its new index entry.

        Raises
        ------
        OSError
            If the folder is missing, or on an error of the disk that does not prove damage.
        StoreError
            If the index cannot be written.
        """
        folder = self._rules.roots[file.kind] / file.name
        if not folder.is_dir():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(folder))
        found = reinspected(file, folder, self._clock.now_ns())
        self.found.n_checked += 1
        self._index.put([found])
        if found.state is WaveformState.DAMAGED:
            self._note_damaged(found)
        return found

    def _note_damaged(self, file: WaveformFile) -> None:
        self.found.n_damaged += 1
        log.error("a recording is damaged", name=file.name, reason=file.reason)

    def _forget(self) -> None:
        now_s = self._clock.monotonic_s()
        if self._forgot_s < 0.0 or now_s - self._forgot_s > DAY_NS / NS_PER_S:
            self._index.forget(self._clock.now_ns() - REMEMBERED_NS)
            self._forgot_s = now_s
