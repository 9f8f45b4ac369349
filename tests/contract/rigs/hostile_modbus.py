"""Devices that lie: a raw Modbus server and a raw serial line that spoil replies on demand."""

import asyncio
import os
import tty
from collections.abc import Callable
from pathlib import Path

from pymodbus.framer import FramerRTU

from acquisition.daq.answers import ReadableDevice, answer

_MBAP_HEAD_BYTES = 6
_RTU_READ_BYTES = 8
_RTU_FIFO_READ_BYTES = 6


class Liar:
    """Answers as a device does; after `n_honest` more replies the lie takes over.

    A lie gets request, right reply and a writer, and sends what it likes. It is told until it is
    taken away.
    """

    def __init__(self, device: ReadableDevice) -> None:
        self.lie: Callable | None = None
        self.n_honest = 0
        self.requests: list[bytes] = []
        self._device = device

    async def respond(self, request: bytes, pdu: bytes, frame: Callable, writer) -> None:
        self.requests.append(request)
        reply = frame(request, answer(pdu, self._device))
        self.n_honest -= 1
        if self.lie is None or self.n_honest >= 0:
            writer.write(reply)
        else:
            await self.lie(request, reply, writer)
        await writer.drain()


class HostileServer(Liar):
    """A Modbus TCP device."""

    port = 0

    def __init__(self, device: ReadableDevice) -> None:
        super().__init__(device)
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def n_connected(self) -> int:
        return len(self._tasks)

    @property
    def endpoint(self) -> dict[str, str | int]:
        return {"host": "127.0.0.1", "port": self.port}

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
                head = await reader.readexactly(_MBAP_HEAD_BYTES)
                request = head + await reader.readexactly(int.from_bytes(head[4:], "big"))
                await self.respond(request, request[7:], tcp_frame, writer)
        except (asyncio.IncompleteReadError, ConnectionError, asyncio.CancelledError):
            pass
        finally:
            self._tasks.discard(task)
            writer.close()


class HostileLine(Liar):
    """A Modbus RTU device on a pseudo-terminal, always found at the same path."""

    def __init__(self, device: ReadableDevice, path: Path) -> None:
        super().__init__(device)
        self.path = path
        self._requests: asyncio.Queue[bytes] = asyncio.Queue()
        self._received = b""
        self._received_at_s = 0.0

    @property
    def endpoint(self) -> dict[str, str | int]:
        return {"device": str(self.path), "parity": "none"}

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
            request = await self._requests.get()
            await self.respond(request, request[1:-2], rtu_frame, self)

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
        is_fifo = self._received[1:2] == b"\x18"
        if len(self._received) == (_RTU_FIFO_READ_BYTES if is_fifo else _RTU_READ_BYTES):
            self._requests.put_nowait(self._received)
            self._received = b""


def tcp_frame(request: bytes, pdu: bytes) -> bytes:
    return request[:4] + (1 + len(pdu)).to_bytes(2, "big") + request[6:7] + pdu


def rtu_frame(request: bytes, pdu: bytes) -> bytes:
    body = request[:1] + pdu
    return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")
