"""What a service manager hears from the program, and what `/readyz` says of its loops."""

import asyncio
import socket
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

STATUS = "STATUS=0 of 2 units connected"


class Manager:
    """Reads all that comes, at once: a full queue would make the program drop messages."""

    def __init__(self, listener: socket.socket) -> None:
        self.told: list[str] = []
        self._news = asyncio.Condition()
        self.listening = asyncio.create_task(self._listen(listener))

    async def until(self, condition: Callable[[list[str]], bool]) -> None:
        async with asyncio.timeout(240.0), self._news:
            await self._news.wait_for(lambda: condition(self.told))

    async def _listen(self, listener: socket.socket) -> None:
        while True:
            message = await asyncio.get_running_loop().sock_recv(listener, 4096)
            async with self._news:
                self.told.append(message.decode())
                self._news.notify_all()


@pytest.fixture
async def manager(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Manager]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "200000")
        monkeypatch.delenv("WATCHDOG_PID", raising=False)
        manager = Manager(listener)
        yield manager
        manager.listening.cancel()
        await asyncio.wait([manager.listening])


async def test_the_service_manager_is_told_from_the_start_to_the_end(
    start: Any, write_plant: Callable[..., Path], tmp_path: Path, manager: Manager
) -> None:
    program = await start("run", str(write_plant(tmp_path)), "--port", "0")
    await program.wait_for_url()
    await manager.until(lambda told: f"READY=1\n{STATUS}" in told)
    await manager.until(lambda told: told.count(f"WATCHDOG=1\n{STATUS}") >= 5)
    checks = (await program.get("/readyz"))["checks"]
    assert await program.end() == 0
    await manager.until(lambda told: told[-1] == "STOPPING=1\nSTATUS=stopping")

    assert {said for name, said in checks.items() if name.startswith("loop ")} == {"alive"}
