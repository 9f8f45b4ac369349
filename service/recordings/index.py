"""Which recordings there are, and whether each is whole."""

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
from acquisition.recordings.summary import summary_of
from service.recordings.folders import DAMAGED, UNFINISHED, finished, is_recording, n_bytes_of
from service.store.waveforms import WaveformFile, WaveformKind, WaveformState, WaveformStore

Key = tuple[WaveformKind, str]

ON_DISK = (WaveformState.PRESENT, WaveformState.DAMAGED)


class Index:
    """All entries but those of what was removed; used by one thread."""

    def __init__(self, store: WaveformStore, place: str) -> None:
        self._store, self.place = store, place
        self._files = {(file.kind, file.name): file for file in store.files(place)}
        self._owed: dict[Key, WaveformFile] = {}

    def get(self, kind: WaveformKind, name: str) -> WaveformFile | None:
        """The entry of a recording."""
        return self._files.get((kind, name))

    def names(self, kind: WaveformKind) -> set[str]:
        """Names of the recordings of a kind that should be on the disk."""
        return {f.name for f in self._files.values() if f.kind is kind and f.state in ON_DISK}

    @property
    def on_disk(self) -> Sequence[WaveformFile]:
        """Recordings that are there, damaged or not."""
        return [file for file in self._files.values() if file.state in ON_DISK]

    @property
    def faults(self) -> Mapping[str, str]:
        """Why each damaged recording is none to be served, by name."""
        return {f.name: f.reason for f in self._files.values() if f.state is WaveformState.DAMAGED}

    def put(self, files: Iterable[WaveformFile]) -> None:
        """Write entries.

        Raises
        ------
        StoreError
            If none was written.
        """
        found = {(file.kind, file.name): file for file in files}
        if found:
            self._store.put(list(found.values()))
            self._files |= found
            for key in found:
                self._owed.pop(key, None)  # there is one of that name again

    def remove(self, file: WaveformFile, reason: str, now_ns: int) -> None:
        """Strike out what is gone; `settle` tells the store."""
        gone = replace(file, state=WaveformState.REMOVED, reason=reason, changed_ns=now_ns)
        self._files.pop((file.kind, file.name), None)
        self._owed[file.kind, file.name] = gone

    def settle(self) -> None:
        """Tell the store what is gone; what it does not take is told the next time.

        Raises
        ------
        StoreError
            If it takes nothing.
        """
        if self._owed:
            self._store.put(list(self._owed.values()))
            self._owed.clear()

    def mark(
        self, files: Iterable[WaveformFile], state: WaveformState, reason: str, now_ns: int
    ) -> None:
        """Give entries another state.

        Raises
        ------
        StoreError
            If none was written.
        """
        self.put(replace(f, state=state, reason=reason, changed_ns=now_ns) for f in files)

    @property
    def whole(self) -> Sequence[WaveformFile]:
        """Recordings that are there and not known to be damaged."""
        return [f for f in self._files.values() if f.state is WaveformState.PRESENT]

    def forget(self, before_ns: int) -> None:
        """Drop what has long been gone.

        Raises
        ------
        StoreError
            If nothing was dropped.
        """
        self._store.forget(self.place, before_ns)
        gone = [
            key
            for key, file in self._files.items()
            if file.state is WaveformState.MISSING and file.changed_ns < before_ns
        ]
        for key in gone:
            del self._files[key]


OF_THE_FILES = (errno.ENOENT, errno.EISDIR, errno.ENOTDIR, errno.ELOOP, errno.EINVAL)
"""What the system says of what lies there; all else may be otherwise at the next try."""


def inspected(folder: Path, place: str, kind: WaveformKind, now_ns: int) -> WaveformFile:
    """Read all of a recording and describe it; one that is not what it should be is damaged.

    Raises
    ------
    OSError
        If the disk or the system refuses to read it now: that says nothing of the recording.
    """
    bare = WaveformFile(
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
        summary = summary_of(recording := open_recording(folder))
        return replace(
            bare,
            unit=recording.manifest.unit,
            start_ns=summary.start_ns,
            stop_ns=summary.stop_ns,
            n_samples=summary.n_samples,
            checksum=manifest_checksum(folder),
        )
    except (ConfigError, OSError) as error:
        _raise_refusal(error, folder)
        return replace(bare, state=WaveformState.DAMAGED, reason=told(error, folder))


def again(known: WaveformFile, folder: Path, now_ns: int) -> WaveformFile:
    """Read all of a recording that is known; what is otherwise than it was is damaged.

    Raises
    ------
    OSError
        If the disk or the system refuses to read it now.
    """
    found = inspected(folder, known.place, known.kind, now_ns)
    if found.state is WaveformState.PRESENT and found.checksum != known.checksum:
        reason = "its manifest is not the one that it was finished with"
        found = replace(found, state=WaveformState.DAMAGED, reason=reason)
    if found.state is WaveformState.PRESENT:
        return replace(known, checked_ns=now_ns)
    return replace(
        known,
        state=WaveformState.DAMAGED,
        reason=found.reason,
        changed_ns=now_ns,
        checked_ns=now_ns,
    )


def manifest_checksum(folder: Path) -> str:
    """SHA-256 of the manifest of a recording.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    return hashlib.sha256((folder / MANIFEST).read_bytes()).hexdigest()


def _raise_refusal(error: BaseException, folder: Path) -> None:
    """Raise what the disk or the system said, unless it said what lies there.

    A reader puts its own words around that. An error without a number is one of the format, for
    which libraries have the same name.
    """
    said: BaseException | None = error
    while said is not None:
        if isinstance(said, MemoryError):
            raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM), folder.name) from error
        if isinstance(said, OSError) and said.errno is not None and said.errno not in OF_THE_FILES:
            raise OSError(said.errno, said.strerror, folder.name) from error
        said = said.__cause__


def told(error: Exception, folder: Path) -> str:
    """An error without the way to the folder."""
    return str(error).replace(str(folder), folder.name)[:500]


class Found(StrEnum):
    """What a recording is found to be."""

    SOUND = "sound"
    NOT_ENTERED = "not_entered"
    DAMAGED = "damaged"
    MISSING = "missing"
    UNFINISHED = "unfinished"


@dataclass(frozen=True)
class Verdict:
    """What was found of one recording.

    Parameters
    ----------
    reason
        Why it is not sound; empty if it is.
    """

    kind: WaveformKind
    name: str
    found: Found
    reason: str = ""


class RecordingCheck:
    """Reads all recordings below some folders.

    Parameters
    ----------
    files
        What the index says of them.
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

    def verdicts(self) -> Iterator[Verdict]:
        """Read one after the other.

        Raises
        ------
        OSError
            If a disk refuses.
        """
        for kind, name in self._there:
            yield self._read(kind, name)
        for kind, name in sorted(set(self._known) - set(self._there)):
            yield Verdict(kind, name, Found.MISSING, "the index has it, its folder does not")
        for kind, root in self._roots.items():
            for path in sorted(root.iterdir()) if root.is_dir() else ():
                if path.name.endswith(UNFINISHED):
                    words = "it is being written, or a start of the service finishes it"
                    yield Verdict(kind, path.name, Found.UNFINISHED, words)

    def _read(self, kind: WaveformKind, name: str) -> Verdict:
        folder, known = self._roots[kind] / name, self._known.get((kind, name))
        try:
            if known is None or not known.checksum or name.endswith(DAMAGED):
                found = inspected(folder, "", kind, self._now_ns)
            else:
                found = again(known, folder, self._now_ns)
        except OSError as error:  # nothing comes of it here but that somebody looks
            return Verdict(kind, name, Found.DAMAGED, f"it cannot be read: {error.strerror}")
        if found.state is WaveformState.DAMAGED:
            return Verdict(kind, name, Found.DAMAGED, found.reason)
        if known is None:
            words = "the running service enters it into the index"
            return Verdict(kind, name, Found.NOT_ENTERED, words)
        return Verdict(kind, name, Found.SOUND)


AGAIN_S = 60.0
"""After how long one is tried again; the others come meanwhile."""

Words = tuple[int, str, str]
"""Number and text of an error, and of which recording."""


class Unread:
    """Remembers what the disk or the system refused to read, and when that is tried again."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._refused: dict[tuple[WaveformKind, str], tuple[float, Words]] = {}

    def is_due(self, kind: WaveformKind, name: str) -> bool:
        """Whether a recording may be read now."""
        tried = self._refused.get((kind, name))
        return tried is None or self._clock.monotonic_s() - tried[0] >= AGAIN_S

    @contextmanager
    def noted(self, kind: WaveformKind, name: str) -> Iterator[None]:
        """Remember it if the disk refuses in here, and forget it if it does not."""
        try:
            yield
        except OSError as error:
            words = (error.errno or 0, error.strerror or str(error), name)
            self._refused[kind, name] = (self._clock.monotonic_s(), words)
        else:
            self._refused.pop((kind, name), None)

    def keep(self, kind: WaveformKind, names: Collection[str]) -> None:
        """Forget all others of a kind."""
        gone = [key for key in self._refused if key[0] is kind and key[1] not in names]
        for key in gone:
            del self._refused[key]

    def tell(self) -> None:
        """Raise what was refused first and still is.

        Raises
        ------
        OSError
            If anything is.
        """
        for _, words in self._refused.values():
            raise OSError(*words)
