"""slcan servers: the simulated CAN DAQ behind a serial adapter, on a TCP port or a pseudo-terminal.

The text protocol of Lawicel's adapters, with the FD lines ``d D b B`` of newer ones and the state
lines ``s`` and ``e`` of Linux' slcan driver.
"""

import asyncio
import os
import tty
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from acquisition.clock import Clock
from acquisition.errors import LinkError
from acquisition.simulated.devices import line_link
from acquisition.simulated.devices.can_device import CanDevice, Item
from acquisition.simulated.devices.can_frames import FD_LENGTHS, FrameKind, WireFrame
from acquisition.simulated.devices.can_server import CanDaqServer

_MAX_COMMAND = 64
_OK, _ERROR = b"\r", b"\a"
_OPENS, _SETS = b"OL", b"SYs"
_BUS_OFF_LINE, _ERROR_LINE = b"sb256256\r", b"e1B\r"


def slcan_line(frame: WireFrame) -> bytes:
    """A frame as text."""
    if frame.kind is FrameKind.BUS_OFF:
        return _BUS_OFF_LINE
    if frame.kind is FrameKind.ERROR:
        return _ERROR_LINE
    letter = "r" if frame.kind is FrameKind.REMOTE else "b" if frame.fd else "t"
    code = FD_LENGTHS.index(_padded(len(frame.data)))
    data = frame.data.ljust(FD_LENGTHS[code], b"\0").hex().upper()
    if frame.extended:
        return f"{letter.upper()}{frame.frame_id:08X}{code:X}{data}\r".encode()
    return f"{letter}{frame.frame_id:03X}{code:X}{data}\r".encode()


def _padded(length: int) -> int:
    return next(n for n in FD_LENGTHS if n >= length)


class _SlcanServer(CanDaqServer):
    """Commands and the state of the adapter's channel.

    Attributes
    ----------
    commands
        How often each command letter has come; frames to be sent have ``t``, ``T``, ``r``, ….
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

    async def _write(self, data: bytes) -> None:
        raise NotImplementedError

    def _answer(self, data: bytes) -> bytes:
        """Carry out the commands that came; return the answers."""
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
    """An slcan adapter on a TCP port; a new reader takes the place of an old one.

    Parameters
    ----------
    port
        0 takes a free one, and keeps it.
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
        """Where a reader finds it."""
        return {"interface": "slcan", "channel": f"socket://{self._host}:{self._port}"}

    async def _plug_in(self) -> None:
        where = f"{self._host}:{self._port}"
        try:
            self._server = await asyncio.start_server(self._accept, self._host, self._port)
        except OSError as exc:
            raise LinkError(f"cannot listen on {where}: {exc.strerror}") from exc
        self._port = self._server.sockets[0].getsockname()[1]

    async def _pull_out(self) -> None:
        self._server.close()
        self.cut()
        if self._connections:
            await asyncio.wait(self._connections)
        await self._server.wait_closed()

    def cut(self) -> None:
        """Close the connection."""
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
    """An slcan adapter at a pseudo-terminal.

    Parameters
    ----------
    link
        A symbolic link to be kept on the terminal, whose own name changes with each plugging in.
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
        self._link = link
        self._master = self._slave = -1
        self._path = ""
        self._writable = asyncio.Event()

    @property
    def endpoint(self) -> Mapping[str, str | int]:
        """Where a reader finds it."""
        return {"interface": "slcan", "channel": str(self._link or self._path)}

    async def _plug_in(self) -> None:
        self._attach()

    def _attach(self) -> None:
        try:
            self._master, self._slave = os.openpty()
        except OSError as exc:
            raise LinkError(f"cannot make a pseudo-terminal: {exc.strerror}") from exc
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._path = os.ttyname(self._slave)
        if self._link is not None:
            line_link.point(self._link, self._path)
        asyncio.get_running_loop().add_reader(self._master, self._read)

    async def _pull_out(self) -> None:
        self._detach()

    def _detach(self) -> None:
        self._open.clear()
        loop = asyncio.get_running_loop()
        loop.remove_reader(self._master)
        loop.remove_writer(self._master)
        os.close(self._master)
        os.close(self._slave)
        self._master = -1
        self._writable.set()
        if self._link is not None:
            line_link.remove(self._link)

    def cut(self) -> None:
        """Unplug the adapter and plug it in again."""
        self._detach()
        self._attach()

    def _read(self) -> None:
        with suppress(BlockingIOError):
            data = os.read(self._master, 4096)
            with suppress(BlockingIOError):
                os.write(self._master, self._answer(data))

    async def _write(self, data: bytes) -> None:
        while data and self._open.is_set():
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                await self._room()

    async def _room(self) -> None:
        """Wait until the terminal takes more."""
        loop = asyncio.get_running_loop()
        master = self._master
        self._writable.clear()
        loop.add_writer(master, self._writable.set)
        try:
            await self._writable.wait()
        finally:
            if master == self._master:
                loop.remove_writer(master)
