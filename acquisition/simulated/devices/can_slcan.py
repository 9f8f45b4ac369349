"""Simulated slcan adapters (CAN over a serial line) on a TCP port or a pseudo-terminal.

The protocol is the text protocol of Lawicel adapters, with the FD lines ``d D b B`` of newer
adapters and the state lines ``s`` and ``e`` of the slcan driver of Linux.
"""

import asyncio
from abc import abstractmethod
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from can.util import dlc2len, len2dlc

from acquisition.clock import Clock
from acquisition.errors import LinkError
from acquisition.simulated.devices.can_device import CanDevice, Item
from acquisition.simulated.devices.can_frames import FrameKind, WireFrame
from acquisition.simulated.devices.can_server import CanDaqServer
from acquisition.simulated.devices.server import PseudoTerminal

_MAX_COMMAND = 64
_OK, _ERROR = b"\r", b"\a"
_OPENS, _SETS = b"OL", b"SYs"
_BUS_OFF_LINE, _ERROR_LINE = b"sb256256\r", b"e1B\r"


def slcan_line(frame: WireFrame) -> bytes:
    """Return the slcan line of a frame, including the carriage return at its end."""
    if frame.kind is FrameKind.BUS_OFF:
        return _BUS_OFF_LINE
    if frame.kind is FrameKind.ERROR:
        return _ERROR_LINE
    letter = "r" if frame.kind is FrameKind.REMOTE else "b" if frame.fd else "t"
    code = len2dlc(len(frame.data))
    data = frame.data.ljust(dlc2len(code), b"\0").hex().upper()
    if frame.extended:
        return f"{letter.upper()}{frame.frame_id:08X}{code:X}{data}\r".encode()
    return f"{letter}{frame.frame_id:03X}{code:X}{data}\r".encode()


class _SlcanServer(CanDaqServer):
    """Base class of the slcan servers: commands of the client, and state of the CAN channel.

    Attributes
    ----------
    commands
        Number of received commands by letter; ``t``, ``T``, ``r``, … are frames from the client.
    """

    def __init__(
        self, device: CanDevice, clock: Clock | None, on_demand: bool, patient: bool
    ) -> None:
        super().__init__(device, clock, on_demand, patient, as_line=slcan_line)
        self.commands: Counter[str] = Counter()
        self._open = asyncio.Event()
        self._bus_off = False
        self._command = b""

    async def _listened_to(self) -> None:
        await self._open.wait()

    async def _send(self, items: Sequence[Item]) -> None:
        lines: list[bytes] = []
        for item in items:
            if self._bus_off:
                break
            lines.append(item if isinstance(item, bytes) else slcan_line(item))
            self._bus_off = isinstance(item, WireFrame) and item.kind is FrameKind.BUS_OFF
        await self._write(b"".join(lines))

    @abstractmethod
    def cut(self) -> None:
        """Close the client's connection abruptly, like a brief interruption of the cable."""

    @abstractmethod
    async def _write(self, data: bytes) -> None:
        """Send bytes; wait while the client does not read them."""

    def _faults_by_name(self) -> Mapping[str, Callable[[int], None]]:
        return {**super()._faults_by_name(), "cut": lambda _: self.cut()}

    def _answer(self, data: bytes) -> bytes:
        """Execute the complete commands received so far, and return the replies to them."""
        *commands, self._command = (self._command + data).split(b"\r")
        self._command = self._command[:_MAX_COMMAND]
        return b"".join(self._carried_out(command) for command in commands)

    def _carried_out(self, command: bytes) -> bytes:
        letter = command[:1]
        if letter:
            self.commands[letter.decode("latin-1")] += 1
        if letter == b"C":
            self._open.clear()
        elif letter and letter in _OPENS:
            self._bus_off = False
            self._open.set()
        elif letter and letter not in _SETS:
            return _ERROR
        return _OK


class SlcanTcpServer(_SlcanServer):
    """Simulated slcan adapter on a TCP port; a new client replaces the previous client.

    Port 0 selects a free port, which is kept when the server is entered again. Without a clock,
    `on_demand` produces a block when all are sent; with one, `patient` waits for the client.
    """

    def __init__(
        self,
        device: CanDevice,
        clock: Clock | None = None,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        on_demand: bool = False,
        patient: bool = False,
    ) -> None:
        super().__init__(device, clock, on_demand, patient)
        self._host = host
        self._port = port
        self._writer: asyncio.StreamWriter | None = None
        self._connections: set[asyncio.Task[None]] = set()

    @property
    def endpoint(self) -> Mapping[str, str | int]:
        """python-can interface and URL of the TCP socket, by key."""
        return {"interface": "slcan", "channel": f"socket://{self._host}:{self._port}"}

    async def _plug_in(self) -> None:
        where = f"{self._host}:{self._port}"
        try:
            self._server = await asyncio.start_server(self._accept, self._host, self._port)
        except OSError as exc:
            raise LinkError(
                f"cannot listen on {where}: {exc.strerror}; choose another port"
            ) from exc
        self._port = self._server.sockets[0].getsockname()[1]

    async def _pull_out(self) -> None:
        self._server.close()
        self.cut()
        if self._connections:
            await asyncio.wait(self._connections)
        await self._server.wait_closed()

    def cut(self) -> None:
        """Close the connection of the client abruptly."""
        self._open.clear()
        if self._writer is not None:
            self._writer.transport.abort()
            self._writer = None

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.create_task(self._talk(reader, writer), name="can daq server connection")
        self._connections.add(task)
        task.add_done_callback(self._connections.discard)

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.cut()
        self._writer, self._command = writer, b""
        with suppress(ConnectionError):
            while data := await reader.read(4096):
                writer.write(self._answer(data))
        if self._writer is writer:
            self.cut()
        writer.close()

    async def _write(self, data: bytes) -> None:
        if self._writer is not None:
            with suppress(ConnectionError):
                self._writer.write(data)
                await self._writer.drain()


class SlcanPtyServer(_SlcanServer):
    """Simulated slcan adapter on a pseudo-terminal.

    `link` is the path of a symbolic link to the terminal; None for no link. Without a clock,
    `on_demand` produces a block when all are sent; with one, `patient` waits for the client.
    """

    def __init__(
        self,
        device: CanDevice,
        clock: Clock | None = None,
        *,
        link: Path | None = None,
        on_demand: bool = False,
        patient: bool = False,
    ) -> None:
        super().__init__(device, clock, on_demand, patient)
        self._line = PseudoTerminal(link, self._receive)

    @property
    def endpoint(self) -> Mapping[str, str | int]:
        """python-can interface and path of the terminal, by key."""
        return {"interface": "slcan", "channel": self._line.name}

    async def _plug_in(self) -> None:
        self._line.open()

    async def _pull_out(self) -> None:
        self._open.clear()
        self._line.close()

    def cut(self) -> None:
        """Close the pseudo-terminal and open a new one."""
        self._open.clear()
        self._line.close()
        self._line.open()

    def _receive(self, data: bytes) -> None:
        self._line.write(self._answer(data))

    async def _write(self, data: bytes) -> None:
        while data and self._open.is_set():
            data = self._line.write(data)
            if data:
                await self._line.writable()
