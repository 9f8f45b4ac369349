"""Devices that lie: a raw Modbus server and a raw serial line that spoil replies on demand."""

import asyncio
import os
import tty
from collections.abc import Callable
from pathlib import Path

from pymodbus.framer import FramerRTU

from acquisition.daq.register_memory import RegisterMemory

_TCP_READ_BYTES = 12
_RTU_READ_BYTES = 8


class Liar:
    """Answers reads of registers from a memory; after `n_honest` more replies the lie takes over.

    A lie gets request, right reply and a writer, and sends what it likes. It is told until it is
    taken away.
    """

    def __init__(self, memory: RegisterMemory) -> None:
        self.lie: Callable | None = None
        self.n_honest = 0
        self.requests: list[bytes] = []
        self._memory = memory

    async def respond(self, request: bytes, pdu_at: int, frame: Callable, writer) -> None:
        self.requests.append(request)
        function, address, count = (
            request[pdu_at],
            int.from_bytes(request[pdu_at + 1 : pdu_at + 3], "big"),
            int.from_bytes(request[pdu_at + 3 : pdu_at + 5], "big"),
        )
        data = self._memory.read(address, count)
        reply = frame(request, bytes([function, len(data)]) + data)
        self.n_honest -= 1
        if self.lie is None or self.n_honest >= 0:
            writer.write(reply)
        else:
            await self.lie(request, reply, writer)
        await writer.drain()


class HostileServer(Liar):
    """A Modbus TCP device."""

    port = 0

    def __init__(self, memory: RegisterMemory) -> None:
        super().__init__(memory)
        self._tasks: set[asyncio.Task[None]] = set()

    async def __aenter__(self) -> "HostileServer":
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        self._server.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._server.wait_closed()

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        self._tasks.add(task)
        try:
            while True:
                request = await reader.readexactly(_TCP_READ_BYTES)
                await self.respond(request, 7, tcp_frame, writer)
        except (asyncio.IncompleteReadError, ConnectionError, asyncio.CancelledError):
            pass
        finally:
            self._tasks.discard(task)
            writer.close()


class HostileLine(Liar):
    """A Modbus RTU device on a pseudo-terminal, always found at the same path."""

    def __init__(self, memory: RegisterMemory, path: Path) -> None:
        super().__init__(memory)
        self.path = path
        self._requests: asyncio.Queue[bytes] = asyncio.Queue()
        self._received = b""
        self._received_at_s = 0.0

    async def __aenter__(self) -> "HostileLine":
        self._open()
        self._answering = asyncio.create_task(self._answer())
        return self

    async def __aexit__(self, *_: object) -> None:
        self._answering.cancel()
        await asyncio.gather(self._answering, return_exceptions=True)
        self._close()

    def write(self, data: bytes) -> None:
        """Send bytes, asked or not."""
        os.write(self._ours, data)

    async def drain(self) -> None:
        pass

    def close(self) -> None:
        """Take the line away; another one comes in its place."""
        self._close()
        self._open()

    async def _answer(self) -> None:
        while True:
            await self.respond(await self._requests.get(), 1, rtu_frame, self)

    def _open(self) -> None:
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(self._theirs))
        asyncio.get_running_loop().add_reader(self._ours, self._take)

    def _close(self) -> None:
        asyncio.get_running_loop().remove_reader(self._ours)
        os.close(self._ours)
        os.close(self._theirs)

    def _take(self) -> None:
        now_s = asyncio.get_running_loop().time()
        if now_s - self._received_at_s > 0.02:
            self._received = b""  # what was left of a request that never became whole
        self._received_at_s = now_s
        self._received += os.read(self._ours, 4096)
        if len(self._received) == _RTU_READ_BYTES:
            self._requests.put_nowait(self._received)
            self._received = b""


def tcp_frame(request: bytes, pdu: bytes) -> bytes:
    return request[:4] + (1 + len(pdu)).to_bytes(2, "big") + request[6:7] + pdu


def rtu_frame(request: bytes, pdu: bytes) -> bytes:
    body = request[:1] + pdu
    return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")
