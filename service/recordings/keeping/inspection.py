"""What a recording is found to be when all of it is read."""

import errno
import hashlib
import os
from dataclasses import replace
from pathlib import Path

from acquisition.errors import ConfigError
from acquisition.recordings.manifest import MANIFEST
from acquisition.recordings.reader import open_recording
from acquisition.recordings.summary import summary_of
from service.recordings.keeping.folders import n_bytes_of
from service.store.waveform_port import WaveformFile, WaveformKind, WaveformState

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
