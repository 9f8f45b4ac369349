"""One process looks after the recordings in a folder, though several may write them."""

import fcntl
import os
from pathlib import Path

LOCK = "recordings.lock"


class WatchKeeping:
    """Held until the process ends, however that happens; the file means nothing by itself."""

    def __init__(self, data_folder: Path) -> None:
        self._path = data_folder / LOCK
        self._descriptor: int | None = None

    def take(self) -> bool:
        """Whether this process is the one; asks anew each time until it is.

        Raises
        ------
        OSError
            If the folder cannot be written to.
        """
        if self._descriptor is not None:
            return True
        self._path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            return False
        self._descriptor = descriptor
        return True

    def release(self) -> None:
        """Let another process do it."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
