"""On what kind of file system a folder is: some lose what SQLite believes to be safe."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

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
