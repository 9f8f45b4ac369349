"""Read a whole small file: settings, a calibration sheet, a DBC."""

import errno
import stat
from pathlib import Path


def read_small_file(path: Path, max_bytes: int) -> bytes:
    """Read a whole file.

    Raises
    ------
    OSError
        If it cannot be read, is no regular file (a pipe would be waited for without end), or is
        larger than allowed; `strerror` says which.
    """
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "Is a directory")
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "not a regular file")
    with path.open("rb") as file:
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:
        raise OSError(errno.EFBIG, f"larger than {max_bytes} bytes")
    return content
