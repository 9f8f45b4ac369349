"""Checks of a data folder: local file system, permissions, and lock file of the database."""

import fcntl
import os
import pwd
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import structlog

from service.store.port import StoreError

MOUNTS = Path("/proc/self/mountinfo")

OVER_A_NETWORK = frozenset(
    (
        *("9p", "acfs", "afs", "beegfs", "ceph", "cifs", "coda", "glusterfs", "gpfs", "lustre"),
        *("ncpfs", "nfs", "nfs4", "orangefs", "prl_fs", "pvfs2", "smb2", "smb3", "smbfs"),
        *("vboxsf", "vmhgfs", "webdav"),
        *("fuse.cephfs", "fuse.ceph-fuse", "fuse.curlftpfs", "fuse.davfs", "fuse.gcsfuse"),
        *("fuse.glusterfs", "fuse.goofys", "fuse.mfs", "fuse.mount-s3", "fuse.rclone"),
        *("fuse.s3fs", "fuse.sshfs", "fuse.vmhgfs-fuse"),
    )
)
"""Kernel names of network file systems. Their locks and shared memory do not exclude other
machines, and an acknowledged write may not be on a disk."""

_MEMORY = "is in memory: all results are lost when the machine restarts"
_CONTAINER = "belongs to a container: results are lost when it is replaced; mount a volume"
_NO_JOURNAL = "has no journal: a power cut may destroy the whole folder"
FORGETFUL = {
    "tmpfs": _MEMORY,
    "ramfs": _MEMORY,
    "overlay": _CONTAINER,
    "aufs": _CONTAINER,
    "vfat": _NO_JOURNAL,
    "exfat": _NO_JOURNAL,
    "virtiofs": "is on another machine, whose settings decide whether acknowledged writes are kept",
}
FUSE = "is served by a program that may not keep acknowledged writes"


@dataclass(frozen=True)
class FileSystem:
    """File system of a folder.

    Parameters
    ----------
    kind
        File system type used by the kernel; empty if unknown.
    is_remote
        Whether the type is a network file system, which must not be used for results.
    warning
        Reason why results may be lost on the file system; empty if results are safe.
    """

    kind: str
    is_remote: bool = False
    warning: str = ""


def _mounts() -> str:
    try:
        return MOUNTS.read_text(encoding="utf-8", errors="surrogateescape")
    except OSError:
        return ""  # not Linux


def file_system_of(folder: Path, mounts: Callable[[], str] = _mounts) -> FileSystem:
    """Return the file system of a folder; the folder need not exist.

    Parameters
    ----------
    mounts
        Function that returns the text of the kernel's mount table.
    """
    place, found = folder.resolve(), ""
    depth = -1
    # a later mount hides an earlier one at the same mount point
    for line in mounts().splitlines():
        before, _, after = line.partition(" - ")
        fields, kinds = before.split(" "), after.split(" ")
        if len(fields) < 5 or not kinds[0]:
            continue
        point = Path(_unescaped(fields[4]))
        if place.is_relative_to(point) and len(point.parts) >= depth:
            depth, found = len(point.parts), kinds[0]
    return _judged(found)


def _judged(kind: str) -> FileSystem:
    if kind in OVER_A_NETWORK:
        return FileSystem(kind, is_remote=True)
    if kind in FORGETFUL:
        return FileSystem(kind, warning=FORGETFUL[kind])
    return FileSystem(kind, warning=FUSE if kind.startswith("fuse") else "")


def _unescaped(text: str) -> str:
    for code, character in (("\\040", " "), ("\\011", "\t"), ("\\012", "\n"), ("\\134", "\\")):
        text = text.replace(code, character)
    return text


BESIDE = ("-wal", "-shm", ".lock")
"""Suffixes of the auxiliary files beside the database."""


def why_unusable(path: Path) -> str | None:
    """Return the reason why a database cannot be stored at a path; None if the path is usable.

    A missing folder is created. An empty file is accepted as a new database; the high-water mark
    beside it reveals whether another database was replaced.
    """
    folder = path.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        is_directory, is_other = path.is_dir(), path.exists() and not path.is_file()
    except (FileExistsError, NotADirectoryError):
        return f"{folder} cannot be created because a file is in its place: move it away"
    except PermissionError:
        return f"{_user()} may not read or create the folder {folder}: {_give(folder)}"
    if is_directory:
        return f"{path} is a folder, but must be the database file: move the folder away"
    if is_other:
        return f"{path} is not a regular file: move it away"
    return _why_protected(path)


def _why_protected(path: Path) -> str | None:
    folder = path.parent
    if os.statvfs(folder).f_flag & os.ST_RDONLY:
        return f"{folder} is on a file system that is mounted read-only: mount it for writing"
    if not _may(folder, os.W_OK | os.X_OK):
        return f"{_user()} may not create files in {folder}: {_give(folder)}"
    for file in (path, *(path.with_name(path.name + end) for end in BESIDE)):
        if file.exists() and not _may(file, os.R_OK | os.W_OK):
            return f"{_user()} may not read and write {file}: {_give(file)}"
    return None


def _may(path: Path, what: int) -> bool:
    return os.access(path, what, effective_ids=os.access in os.supports_effective_ids)


def _give(path: Path) -> str:
    return f"change its owner to that user (chown) and permit writing (chmod u+rwX {path})"


def _user() -> str:
    number = os.geteuid()
    try:
        return f"the user {pwd.getpwuid(number).pw_name}"
    except KeyError:
        return f"the user with number {number}"


log = structlog.get_logger()

SUFFIX = ".lock"
_PID_BYTES = 20


class AlreadyRunningError(StoreError):
    """Error raised if another service, whose process id is in the message, uses the database."""


@contextmanager
def exclusive_use(
    database: Path, look: Callable[[Path], FileSystem] = file_system_of
) -> Iterator[None]:
    """Return a context manager that locks a database against other services within its block.

    The lock ends with the process. The lock file remains, but alone does not lock the database.

    Parameters
    ----------
    look
        Function that returns the file system of a folder.

    Raises
    ------
    AlreadyRunningError
        If another process holds the lock.
    StoreError
        If the folder is not writable, or is on a network file system.
    """
    path = database.with_name(database.name + SUFFIX)
    _require_local(database.parent, look(database.parent))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise StoreError(why_unusable(database) or f"{path}: {error.strerror}") from error
    try:
        _take(descriptor, database)
        yield
    finally:
        os.close(descriptor)


def _require_local(folder: Path, found: FileSystem) -> None:
    """Reject a network file system; log a warning for a file system that may lose results."""
    if found.is_remote:
        raise StoreError(
            f"{folder} is on a network file system ({found.kind}), where two services may write at"
            " once and acknowledged writes may be lost: choose a data folder on a local disk"
        )
    if found.warning:
        log.warning("results in the data folder may be lost", folder=str(folder), why=found.warning)


def _take(descriptor: int, database: Path) -> None:
    if (holder := take_lock(descriptor)) is not None:
        raise AlreadyRunningError(
            f"another padwatch (process {holder}) uses {database}:"
            " stop it, or choose another data folder"
        )


def take_lock(descriptor: int) -> str | None:
    """Lock a file and write the process id to it; return None, or the current holder's process id.

    The id is "unknown" if the holder has not written it yet.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.pread(descriptor, _PID_BYTES, 0).decode("ascii", "replace").strip()
        return holder or "unknown"
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
    return None
