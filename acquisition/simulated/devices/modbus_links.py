"""Modbus TCP and Modbus RTU servers of a simulated device."""

import asyncio
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import cast

from pymodbus.framer import FramerRTU

from acquisition.clock import Clock
from acquisition.errors import LinkError
from acquisition.simulated.devices.modbus_device import HangUpError, ModbusDevice
from acquisition.simulated.devices.modbus_server import ModbusServer
from acquisition.simulated.devices.server import PseudoTerminal

_MBAP = struct.Struct(">HHHB")
_MIN_LENGTH, _MAX_LENGTH = 2, 254

_FRAME_GAP_S = 0.05
"""Minimum pause between two frames: longer than 3.5 characters, shorter than reader time-outs."""

_REQUEST_BYTES = {0x18: 6, 43: 7}
_MAX_REQUEST_BYTES = 8


class ModbusTcpServer(ModbusServer):
    """Modbus TCP server of a simulated device, for any number of clients.

    Port 0 selects a free port, which the attribute `port` contains after entering. Without a clock,
    data are produced only by ``device.produce``; if `patient`, from the first request on.

    Raises
    ------
    LinkError
        On entering, if the server cannot listen on the port.
    """

    def __init__(
        self,
        device: ModbusDevice,
        clock: Clock | None = None,
        host: str = "127.0.0.1",
        port: int = 0,
        *,
        patient: bool = False,
    ) -> None:
        super().__init__(device, clock, patient=patient)
        self.port = port
        self._host = host
        self._server: asyncio.Server | None = None
        self._connections: set[_Connection] = set()

    @property
    def endpoint(self) -> Mapping[str, str | int]:
        """Host and port of the server."""
        return {"host": self._host, "port": self.port}

    def cut(self) -> None:
        """Close all connections abruptly, like a brief interruption of the cable."""
        for connection in list(self._connections):
            connection.cut()

    async def _plug_in(self) -> None:
        loop = asyncio.get_running_loop()
        try:
            self._server = await loop.create_server(self._accept, self._host, self.port)
        except OSError as exc:
            where = f"{self._host}:{self.port}"
            raise LinkError(
                f"cannot listen on {where}: {exc.strerror}; choose another port"
            ) from exc
        self.port = self._server.sockets[0].getsockname()[1]

    async def _pull_out(self) -> None:
        if self._server is not None:
            self._server.close()
            self.cut()
            await self._server.wait_closed()
            self._server = None

    def _n_connections(self) -> int:
        return len(self._connections)

    def _accept(self) -> "_Connection":
        return _Connection(self, self._connections)


class _Connection(asyncio.Protocol):
    """Connection of one client."""

    def __init__(self, server: ModbusTcpServer, connections: "set[_Connection]") -> None:
        self._server = server
        self._connections = connections
        self._received = b""
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        # transports of uvloop have the methods of asyncio.Transport, but not its class
        self._transport = cast(asyncio.Transport, transport)
        self._connections.add(self)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002
        self._connections.discard(self)
        self._server.finish_without_readers()

    def cut(self) -> None:
        """Abort the connection without sending buffered bytes."""
        self._transport.abort()

    def data_received(self, data: bytes) -> None:
        self._received += data
        while len(self._received) > _MBAP.size:
            tid, protocol, length, unit = _MBAP.unpack_from(self._received)
            if protocol or not _MIN_LENGTH <= length <= _MAX_LENGTH:
                self.cut()
                return
            end = _MBAP.size - 1 + length
            if len(self._received) < end:
                return
            request = self._received[_MBAP.size : end]
            self._received = self._received[end:]
            try:
                reply = self._server.reply(request)
            except HangUpError:
                self.cut()
                return
            if reply is not None:
                self._transport.write(_MBAP.pack(tid, 0, 1 + len(reply), unit) + reply)


class ModbusRtuServer(ModbusServer):
    """Modbus RTU server of a simulated device, for one client on a pseudo-terminal.

    `link` is the path of a symbolic link to the terminal; None for no link. Without a clock, data
    are produced only by ``device.produce``; if `patient`, from the first request on. Entering
    raises ConfigError if the path of the link is in use, and LinkError if the system fails.
    """

    def __init__(
        self,
        device: ModbusDevice,
        clock: Clock | None = None,
        link: Path | None = None,
        *,
        patient: bool = False,
    ) -> None:
        super().__init__(device, clock, patient=patient)
        self._line = PseudoTerminal(link, self._receive)
        self._received = b""
        self._received_at_s = 0.0

    @property
    def endpoint(self) -> Mapping[str, str | int]:
        """Path of the pseudo-terminal, and the parity setting ``none``, by key."""
        return {"device": self._line.name, "parity": "none"}

    def cut(self) -> None:
        """Close the pseudo-terminal and open a new one."""
        self._line.close()
        self._received = b""
        self._line.open()

    async def _plug_in(self) -> None:
        self._line.open()

    async def _pull_out(self) -> None:
        self._line.close()
        self._received = b""

    def _n_connections(self) -> int:
        return 0  # a serial line does not report connected clients

    def _receive(self, data: bytes) -> None:
        now_s = asyncio.get_running_loop().time()
        if now_s - self._received_at_s > _FRAME_GAP_S:
            self._received = b""
        self._received_at_s = now_s
        self._received += data
        n_expected = _request_bytes(self._received)
        if len(self._received) >= n_expected:
            frame, self._received = self._received, b""
            self._answer(frame, n_expected)

    def _answer(self, frame: bytes, n_expected: int) -> None:
        """Reply to a valid frame; ignore a frame with wrong length or checksum."""
        crc = int.from_bytes(frame[-2:], "big")
        if len(frame) != n_expected or not FramerRTU.check_CRC(frame[:-2], crc):
            return
        try:
            reply = self.reply(frame[1:-2])
        except HangUpError:
            self.cut()
            return
        if reply is not None:
            body = frame[:1] + reply
            self._line.write(body + FramerRTU.compute_CRC(body).to_bytes(2, "big"))


def _request_bytes(frame: bytes) -> int:
    """Return the number of bytes of a complete request frame, from its function code."""
    return _REQUEST_BYTES.get(frame[1] if len(frame) > 1 else 0, _MAX_REQUEST_BYTES)
