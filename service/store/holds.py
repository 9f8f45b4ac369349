"""One process for each database, on a file system that can lock."""

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
"""Their locks and shared memory are not those of one machine: two may write at once, and a
commit that was answered may still be on its way."""

_MEMORY = "is memory: all results are gone when the machine restarts"
_CONTAINER = "belongs to a container: results are gone when that is made anew; mount a volume"
_NO_JOURNAL = "has no journal: a power cut may take the whole folder with it"
FORGETFUL = {
    "tmpfs": _MEMORY,
    "ramfs": _MEMORY,
    "overlay": _CONTAINER,
    "aufs": _CONTAINER,
    "vfat": _NO_JOURNAL,
    "exfat": _NO_JOURNAL,
    "virtiofs": "belongs to another machine's disk: whether that keeps what it acknowledges, its"
    " settings say",
}
FUSE = "is served by a program: whether that keeps what it acknowledges is not known"


@dataclass(frozen=True)
class FileSystem:
    """What a folder is on.

    Parameters
    ----------
    kind
        As the kernel calls it; empty where that is not known.
    is_remote
        Whether results must not be kept there.
    warning
        What may happen to results there; empty if they are safe.
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
    """The file system that a folder is on, or will be once it is made.

    Parameters
    ----------
    mounts
        Gives the lines of the kernel's table of mounts.
    """
    place, found = folder.resolve(), ""
    depth = -1
    for line in mounts().splitlines():
        before, _, after = line.partition(" - ")
        fields, kinds = before.split(" "), after.split(" ")
        if len(fields) < 5 or not kinds[0]:
            continue
        point = Path(_unescaped(fields[4]))
        if place.is_relative_to(point) and len(point.parts) >= depth:  # a later one lies over it
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
"""Ends of the names of files that are kept beside the database."""


def why_unusable(path: Path) -> str | None:
    """Why a database cannot be kept there; None if nothing is known against it.

    A folder that is not there is made. An empty file is a new database: whether there was another
    one, the high-water mark beside it says.
    """
    folder = path.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        is_directory, is_other = path.is_dir(), path.exists() and not path.is_file()
    except (FileExistsError, NotADirectoryError):
        return f"{folder} cannot be a folder, for a file is in its place: move it away"
    except PermissionError:
        return f"{_user()} may not look into or make the folder {folder}: {_give(folder)}"
    if is_directory:
        return f"{path} is a folder: move it away, the database is to be a file of that name"
    if is_other:
        return f"{path} is no plain file: move it away"
    return _why_protected(path)


def _why_protected(path: Path) -> str | None:
    folder = path.parent
    if os.statvfs(folder).f_flag & os.ST_RDONLY:
        return f"{folder} is on a file system that is mounted read-only: mount it for writing"
    if not _may(folder, os.W_OK | os.X_OK):
        return f"{_user()} may not make files in {folder}: {_give(folder)}"
    for file in (path, *(path.with_name(path.name + end) for end in BESIDE)):
        if file.exists() and not _may(file, os.R_OK | os.W_OK):
            return f"{_user()} may not read and write {file}: {_give(file)}"
    return None


def _may(path: Path, what: int) -> bool:
    return os.access(path, what, effective_ids=os.access in os.supports_effective_ids)


def _give(path: Path) -> str:
    return f"give it to that user (chown) and let it be written to (chmod u+rwX {path})"


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
    """Another service works with the database; the message says which process it is."""


def lock_path(database: Path) -> Path:
    """The file whose lock a service holds while it works with a database."""
    return database.with_name(database.name + SUFFIX)


@contextmanager
def exclusive_use(database: Path, look: Callable[[Path], FileSystem] = file_system_of) -> Iterator[None]:
    """Be the only service that works with a database.

    The lock ends with the process, however that ends; the file stays and means nothing by itself.

    Parameters
    ----------
    look
        Says what a folder is on.

    Raises
    ------
    AlreadyRunningError
        If another process is.
    StoreError
        If the folder cannot be written to, or is on a network file system.
    """
    path = lock_path(database)
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
    """Refuse a folder whose locks and syncs are those of another machine."""
    if found.is_remote:
        raise StoreError(
            f"{folder} is on a network file system ({found.kind}), where two services may write at"
            " once and what is acknowledged may be lost: choose a data folder on a local disk"
        )
    if found.warning:
        log.warning("the data folder may forget", folder=str(folder), why=found.warning)


def _take(descriptor: int, database: Path) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.pread(descriptor, _PID_BYTES, 0).decode("ascii", "replace").strip()
        raise AlreadyRunningError(
            f"another padwatch (process {holder or 'unknown'}) works with {database}:"
            " stop it, or choose another data folder"
        ) from None
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
