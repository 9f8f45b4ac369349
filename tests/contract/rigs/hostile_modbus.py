"""Devices that lie: a raw Modbus server and a raw serial line that spoil replies on demand."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Self

from pymodbus.framer import FramerRTU

from acquisition.simulated.devices.modbus_device import ModbusDevice, answer
from acquisition.simulated.devices.modbus_links import ModbusRtuServer

_MBAP_HEAD_BYTES = 6


class Liar:
    """Answers as a device does; after `n_honest` more replies the lie takes over.

    A lie gets request, right reply and a writer, and sends what it likes. It is told until it is
    taken away.
    """

    def __init__(self, device: ModbusDevice) -> None:
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


class LoopbackServer:
    """Accepts connections on a free port; they end when it is left."""

    port = 0

    def __init__(self) -> None:
        self._tasks: set[asyncio.Task[None]] = set()

    async def __aenter__(self) -> Self:
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        self._server.close()
        await asyncio.sleep(0)  # what was accepted just now begins, so that it can be ended
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._server.wait_closed()

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        self._tasks.add(task)
        try:
            await self._serve(reader, writer)
        except (asyncio.IncompleteReadError, ConnectionError, asyncio.CancelledError):
            pass
        finally:
            self._tasks.discard(task)
            writer.close()


class HostileServer(LoopbackServer, Liar):
    """A Modbus TCP device."""

    def __init__(self, device: ModbusDevice) -> None:
        LoopbackServer.__init__(self)
        Liar.__init__(self, device)

    @property
    def n_connected(self) -> int:
        return len(self._tasks)

    @property
    def endpoint(self) -> dict[str, str | int]:
        return {"host": "127.0.0.1", "port": self.port}

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while True:
            head = await reader.readexactly(_MBAP_HEAD_BYTES)
            request = head + await reader.readexactly(int.from_bytes(head[4:], "big"))
            await self.respond(request, request[7:], tcp_frame, writer)


class HostileLine(ModbusRtuServer, Liar):
    """A Modbus RTU device on a pseudo-terminal, always found at the same path."""

    def __init__(self, device: ModbusDevice, path: Path) -> None:
        ModbusRtuServer.__init__(self, device, link=path)
        Liar.__init__(self, device)
        self.path = path
        self._frames: asyncio.Queue[bytes] = asyncio.Queue()

    async def __aenter__(self) -> Self:
        self._answering = asyncio.create_task(self._answer_frames())
        return await super().__aenter__()

    async def __aexit__(self, *error: object) -> None:
        self._answering.cancel()
        await asyncio.gather(self._answering, return_exceptions=True)
        await super().__aexit__(*error)

    def write(self, data: bytes) -> None:
        """Send bytes, asked or not."""
        self._line.write(data)

    async def drain(self) -> None:
        pass

    def close(self) -> None:
        """Take the line away; another one comes in its place."""
        self.cut()

    def _answer(self, frame: bytes, n_expected: int) -> None:  # noqa: ARG002
        self._frames.put_nowait(frame)

    async def _answer_frames(self) -> None:
        while True:
            request = await self._frames.get()
            await self.respond(request, request[1:-2], rtu_frame, self)


def tcp_frame(request: bytes, pdu: bytes) -> bytes:
    return request[:4] + (1 + len(pdu)).to_bytes(2, "big") + request[6:7] + pdu


def rtu_frame(request: bytes, pdu: bytes) -> bytes:
    body = request[:1] + pdu
    return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")
