"""A service manager's end of the notification socket."""

import asyncio
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

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


class Gates:
    """A clock whose sleepers wake only when they are let."""

    def __init__(self, clock: Any) -> None:
        self.clock = clock
        self.sleepers: list[asyncio.Future[None]] = []
        self.asked_s: list[float] = []

    def now_ns(self) -> int:
        return int(self.clock.now_ns())

    def monotonic_s(self) -> float:
        return float(self.clock.monotonic_s())

    async def sleep(self, duration_s: float) -> None:
        self.asked_s.append(duration_s)
        if duration_s > 0.0:
            self.sleepers.append(asyncio.get_running_loop().create_future())
            await self.sleepers[-1]

    async def pass_s(self, seconds: float) -> None:
        """Let time pass in steps, with everybody who waits looking at it."""
        for _ in range(round(seconds)):
            self.clock.step(1.0)
            for sleeper in self.sleepers[:]:
                if not sleeper.done():
                    sleeper.set_result(None)
            self.sleepers.clear()
            for _ in range(10):
                await asyncio.sleep(0)


@pytest.fixture
def manager_socket(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[ManagerSocket]:
    r"""A manager that listens at a path; with "\0" as parameter, at an abstract name."""
    opened = ManagerSocket(getattr(request, "param", "") + str(tmp_path / "notify"))
    yield opened
    opened.close()
