"""Names that one process holds among those that use a database file."""

import fcntl
import os
import re
from pathlib import Path
from types import TracebackType

from service.store.port import StoreError

_PID_BYTES = 20


class FileHold:
    """A name held by the lock of a file; it ends with the process, however that ends.

    Parameters
    ----------
    path
        The file; it stays, and means nothing by itself.
    name
        For the message.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path, self._name = path, name
        self._descriptor: int | None = None

    @property
    def is_held(self) -> bool:
        """Whether it is; nobody can take the lock of a file away."""
        return self._descriptor is not None

    def __enter__(self) -> "FileHold":
        try:
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise StoreError(f"{self._path}: {error.strerror}") from error
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(descriptor, _PID_BYTES, 0).decode("ascii", "replace").strip()
            os.close(descriptor)
            raise StoreError(
                f"{self._name} is held by another padwatch (process {holder or 'unknown'}):"
                " stop it first"
            ) from None
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
        self._descriptor = descriptor
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def held(database: Path, name: str) -> FileHold:
    """Build the hold of a name beside a database file."""
    safe = re.sub(r"[^A-Za-z0-9_-]", lambda found: f"%{ord(found[0]):x}", name)
    return FileHold(database.with_name(f"{database.name}.{safe}.lock"), name)
