"""A service manager's end of the notification socket."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest


class ManagerSocket:
    """A bound datagram socket, and what has come to it."""

    def __init__(self, address: str) -> None:
        self.environment = {
            "NOTIFY_SOCKET": address.replace("\0", "@"),
            "WATCHDOG_USEC": "10000000",
        }
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(address)
        self._socket.setblocking(False)

    @property
    def received(self) -> list[dict[str, str]]:
        """What has come since the last look."""
        found = []
        while True:
            try:
                message = self._socket.recv(4096).decode()
            except BlockingIOError:
                return found
            found.append(dict(line.split("=", 1) for line in message.split("\n")))

    def close(self) -> None:
        self._socket.close()


@pytest.fixture(params=["path", "abstract"])
def either_socket(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[ManagerSocket]:
    """A manager that listens at a path, and one that listens at an abstract name."""
    path = str(tmp_path / "notify")
    opened = ManagerSocket(path if request.param == "path" else "\0" + path)
    yield opened
    opened.close()


@pytest.fixture
def manager_socket(tmp_path: Path) -> Iterator[ManagerSocket]:
    opened = ManagerSocket(str(tmp_path / "notify"))
    yield opened
    opened.close()
