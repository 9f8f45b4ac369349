"""A unix socket to listen on: only who may open its file can reach the service."""

import os
import socket
import stat
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from service.api.http.listening import PortInUseError

MODE = 0o660
"""For padwatch's user and its group, which the proxy's user is put into."""


@contextmanager
def socket_file(path: Path) -> Iterator[socket.socket]:
    """Listen on a socket file; it is removed at the end.

    Raises
    ------
    PortInUseError
        If it cannot be made, is something else, or is listened on already.
    """
    _make_way(path)
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) as listener:
        try:
            before = os.umask(0o777 & ~MODE)
            try:
                listener.bind(str(path))
            finally:
                os.umask(before)
            listener.listen(socket.SOMAXCONN)
        except OSError as error:
            raise PortInUseError(f"cannot listen on {path}: {error.strerror}") from error
        try:
            yield listener
        finally:
            path.unlink(missing_ok=True)


def _make_way(path: Path) -> None:
    """Remove what a service that was killed has left."""
    try:
        mode = path.lstat().st_mode
    except OSError:
        return  # binding says what is wrong
    if not stat.S_ISSOCK(mode):
        raise PortInUseError(f"cannot listen on {path}: it is something else than a socket")
    with closing(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)) as caller:
        try:
            caller.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
        except OSError as error:
            raise PortInUseError(f"cannot listen on {path}: {error.strerror}") from error
        else:
            raise PortInUseError(f"cannot listen on {path}: another program does")
