"""`ModbusTcpServer`: a simulated device on a TCP port."""

import asyncio
import struct
from collections.abc import Mapping
from typing import cast

from acquisition.clock import Clock
from acquisition.errors import LinkError
from acquisition.simulated.devices.modbus_answers import HangUpError
from acquisition.simulated.devices.modbus_server import ModbusDevice, ModbusServer

_MBAP = struct.Struct(">HHHB")
_MIN_LENGTH, _MAX_LENGTH = 2, 254


class ModbusTcpServer(ModbusServer):
    """Serves a device to any number of readers.

    Parameters
    ----------
    port
        0 takes a free one; ``port`` then tells which.

    Raises
    ------
    LinkError
        On entering, if the port cannot be listened on.
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
        """Host and port."""
        return {"host": self._host, "port": self.port}

    def cut(self) -> None:
        """Cut every connection, like a pulled cable that is plugged in again."""
        for connection in list(self._connections):
            connection.cut()

    async def _listen(self) -> None:
        loop = asyncio.get_running_loop()
        try:
            self._server = await loop.create_server(self._accept, self._host, self.port)
        except OSError as exc:
            raise LinkError(f"cannot listen on {self._host}:{self.port}: {exc.strerror}") from exc
        self.port = self._server.sockets[0].getsockname()[1]

    async def _stop_listening(self) -> None:
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
    """One reader."""

    def __init__(self, server: ModbusTcpServer, connections: "set[_Connection]") -> None:
        self._server = server
        self._connections = connections
        self._received = b""
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        # uvloop's transports are asyncio.Transports by their methods, but not by their class
        self._transport = cast(asyncio.Transport, transport)
        self._connections.add(self)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002
        self._connections.discard(self)
        self._server.finish_if_nobody_waits()

    def cut(self) -> None:
        """Close without another byte."""
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
