"""Reading of small files, such as settings, calibration sheets and DBC files."""

import errno
import stat
from pathlib import Path


def read_small_file(path: Path, max_bytes: int) -> bytes:
    """Return the content of a regular file of at most `max_bytes`.

    Raises OSError if the file cannot be read, is not a regular file (reading a pipe would block),
    or is too large; `strerror` states the reason.
    """
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "Is a directory")
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "not a regular file")
    with path.open("rb") as file:
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:
        raise OSError(errno.EFBIG, f"file is larger than {max_bytes} bytes")
    return content
