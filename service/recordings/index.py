"""Index of the recordings in a data folder, and checks of recordings against the index."""

import errno
import hashlib
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

from acquisition.clock import Clock
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import MANIFEST
from acquisition.recordings.reader import open_recording
from service.recordings.folders import DAMAGED, UNFINISHED, finished, is_recording, n_bytes_of
from service.store.waveforms import WaveformFile, WaveformKind, WaveformState, WaveformStore

Key = tuple[WaveformKind, str]

ON_DISK = (WaveformState.PRESENT, WaveformState.DAMAGED)


class Index:
    """Index of the recordings in a data folder, loaded from the store; for use in one thread."""

    def __init__(self, store: WaveformStore, place: str) -> None:
        self._store, self.place = store, place
        self._files = {(file.kind, file.name): file for file in store.files(place)}
        self._removed: dict[Key, WaveformFile] = {}

    def get(self, kind: WaveformKind, name: str) -> WaveformFile | None:
        """Return the entry of a recording; None if it is not in the index."""
        return self._files.get((kind, name))

    def names(self, kind: WaveformKind) -> set[str]:
        """Return the names of the indexed recordings of a kind, except missing recordings."""
        return {file.name for file in self.on_disk if file.kind is kind}

    @property
    def on_disk(self) -> Sequence[WaveformFile]:
        """Entries of the recordings on the disk, including damaged recordings."""
        return [file for file in self._files.values() if file.state in ON_DISK]

    @property
    def whole(self) -> Sequence[WaveformFile]:
        """Entries of the recordings on the disk without a known fault."""
        return [f for f in self._files.values() if f.state is WaveformState.PRESENT]

    @property
    def faults(self) -> Mapping[str, str]:
        """Fault of each damaged recording, by name of the recording."""
        return {f.name: f.reason for f in self._files.values() if f.state is WaveformState.DAMAGED}

    def put(self, files: Iterable[WaveformFile]) -> None:
        """Write entries to the index and the store; replace entries of the same kind and name.

        Raises `StoreError` if the store cannot be written; the index is unchanged.
        """
        found = {(file.kind, file.name): file for file in files}
        if found:
            self._store.put(list(found.values()))
            self._files |= found
            for key in found:
                self._removed.pop(key, None)  # the name is in use again

    def remove(self, file: WaveformFile, reason: str, now_ns: int) -> None:
        """Remove an entry from the index in memory; call `store_removals` to update the store."""
        gone = replace(file, state=WaveformState.REMOVED, reason=reason, changed_ns=now_ns)
        self._files.pop((file.kind, file.name), None)
        self._removed[file.kind, file.name] = gone

    def store_removals(self) -> None:
        """Write the removals of entries to the store; after an error they can be written again.

        Raises `StoreError` if the store cannot be written.
        """
        if self._removed:
            self._store.put(list(self._removed.values()))
            self._removed.clear()

    def forget(self, before_ns: int) -> None:
        """Delete the entries of recordings removed or missing since before `before_ns`, ns.

        Raises `StoreError` if the store cannot be written; no entry is then deleted.
        """
        self._store.forget(self.place, before_ns)
        self._files = {
            key: file
            for key, file in self._files.items()
            if file.state is not WaveformState.MISSING or file.changed_ns >= before_ns
        }


DAMAGE_ERRORS = (
    *(errno.ENOENT, errno.EISDIR, errno.ENOTDIR),
    *(errno.ELOOP, errno.EINVAL, errno.EFBIG),
)
"""Values of ``errno`` that mean a damaged recording; after other errors a retry may succeed."""


def inspected(folder: Path, place: str, kind: WaveformKind, now_ns: int) -> WaveformFile:
    """Read a whole recording and return its index entry, which states damage, if any.

    `place` is the identifier of the data folder, and `now_ns` the time of the check.

    Raises
    ------
    OSError
        On an error of the disk or the system that does not prove damage of the recording.
    """
    entry = WaveformFile(
        place=place,
        kind=kind,
        name=folder.name,
        unit="",
        start_ns=0,
        stop_ns=0,
        n_samples=0,
        n_bytes=n_bytes_of(folder),
        checksum="",
        changed_ns=now_ns,
        checked_ns=now_ns,
    )
    try:
        summary = (recording := open_recording(folder)).summary
        return replace(
            entry,
            unit=recording.manifest.unit,
            start_ns=summary.start_ns,
            stop_ns=summary.stop_ns,
            n_samples=summary.n_samples,
            checksum=hashlib.sha256((folder / MANIFEST).read_bytes()).hexdigest(),
        )
    except (ConfigError, OSError) as error:
        _raise_refusal(error, folder)
        reason = str(error).replace(str(folder), folder.name)[:500]
        return replace(entry, state=WaveformState.DAMAGED, reason=reason)


def reinspected(known: WaveformFile, folder: Path, now_ns: int) -> WaveformFile:
    """Read an indexed recording again and return its entry: damaged if its content has changed.

    Raises
    ------
    OSError
        On an error of the disk or the system that does not prove damage of the recording.
    """
    found = inspected(folder, known.place, known.kind, now_ns)
    if found.state is WaveformState.PRESENT and found.checksum == known.checksum:
        return replace(known, checked_ns=now_ns)
    reason = found.reason or "the manifest has changed since the recording was finished"
    state = WaveformState.DAMAGED
    return replace(known, state=state, reason=reason, changed_ns=now_ns, checked_ns=now_ns)


def _raise_refusal(error: BaseException, folder: Path) -> None:
    """Raise `OSError` if an error was caused by the disk or the system, not by damage.

    Such errors are causes of the error from the reader. An `OSError` without an error number is not
    raised: libraries use this class also for format errors.
    """
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, MemoryError):
            raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM), folder.name) from error
        if isinstance(cause, OSError) and cause.errno not in (None, *DAMAGE_ERRORS):
            raise OSError(cause.errno, cause.strerror, folder.name) from error
        cause = cause.__cause__


class RecordingState(StrEnum):
    """Result of a check: sound, not in the index, damaged, missing, or not finished."""

    SOUND = "sound"
    NOT_ENTERED = "not_entered"
    DAMAGED = "damaged"
    MISSING = "missing"
    UNFINISHED = "unfinished"


@dataclass(frozen=True)
class CheckResult:
    """Result of the check of one recording; the reason is empty for an intact one."""

    kind: WaveformKind
    name: str
    found: RecordingState
    reason: str = ""


class RecordingCheck:
    """Check of the recordings in the folders of each kind, `roots`, against index entries, `files`.

    Attributes
    ----------
    n_to_read
        Number of recordings in the folders, which the check reads completely.
    """

    def __init__(
        self, roots: Mapping[WaveformKind, Path], files: Iterable[WaveformFile], now_ns: int
    ) -> None:
        self._roots, self._now_ns = roots, now_ns
        self._known = {(f.kind, f.name): f for f in files if f.state is not WaveformState.REMOVED}
        self._there = [
            (kind, name)
            for kind, root in roots.items()
            for name in sorted(finished(root))
            if is_recording(root / name)
        ]
        self.n_to_read = len(self._there)

    def results(self) -> Iterator[CheckResult]:
        """Read all recordings and yield the results, also for missing and unfinished recordings.

        Raises `OSError` if a folder cannot be read.
        """
        for kind, name in self._there:
            yield self._read(kind, name)
        for kind, name in sorted(set(self._known) - set(self._there)):
            reason = "the folder of the recording is missing"
            yield CheckResult(kind, name, RecordingState.MISSING, reason)
        for kind, root in self._roots.items():
            for path in sorted(root.iterdir()) if root.is_dir() else ():
                if path.name.endswith(UNFINISHED):
                    reason = "in progress, or to be finished at the next start of the service"
                    yield CheckResult(kind, path.name, RecordingState.UNFINISHED, reason)

    def _read(self, kind: WaveformKind, name: str) -> CheckResult:
        folder, known = self._roots[kind] / name, self._known.get((kind, name))
        try:
            if known is None or not known.checksum or name.endswith(DAMAGED):
                found = inspected(folder, "", kind, self._now_ns)
            else:
                found = reinspected(known, folder, self._now_ns)
        except OSError as error:  # reported as damaged, for attention
            reason = f"the recording cannot be read: {error.strerror}"
            return CheckResult(kind, name, RecordingState.DAMAGED, reason)
        if found.state is WaveformState.DAMAGED:
            return CheckResult(kind, name, RecordingState.DAMAGED, found.reason)
        if known is None:
            reason = "not in the index yet; the running service adds it"
            return CheckResult(kind, name, RecordingState.NOT_ENTERED, reason)
        return CheckResult(kind, name, RecordingState.SOUND)


RETRY_S = 60.0
"""Delay in seconds before a recording is read again after an error of the disk."""


class RetryList:
    """List of recordings that the disk or the system could not read, for a later retry."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._refused: dict[Key, tuple[float, OSError]] = {}

    def is_due(self, kind: WaveformKind, name: str) -> bool:
        """Return whether a recording can be read: not listed, or listed for at least `RETRY_S`."""
        tried = self._refused.get((kind, name))
        return tried is None or self._clock.monotonic_s() - tried[0] >= RETRY_S

    @contextmanager
    def noted(self, kind: WaveformKind, name: str) -> Iterator[None]:
        """Return a context manager that adds a recording to the list, or removes it.

        The recording is added after an `OSError`, which is caught, and removed after success.
        """
        try:
            yield
        except OSError as error:
            refusal = OSError(error.errno or 0, error.strerror or str(error), name)
            self._refused[kind, name] = (self._clock.monotonic_s(), refusal)
        else:
            self._refused.pop((kind, name), None)

    def keep(self, kind: WaveformKind, names: Collection[str]) -> None:
        """Remove the recordings of a kind from the list, except recordings with the given names."""
        self._refused = {k: v for k, v in self._refused.items() if k[0] != kind or k[1] in names}

    def raise_first(self) -> None:
        """Raise the error of the recording that was listed first; no effect on an empty list."""
        for _, refusal in self._refused.values():
            raise refusal.with_traceback(None)
