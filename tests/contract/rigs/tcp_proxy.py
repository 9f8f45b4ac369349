"""A TCP proxy that treats what passes through it badly, the same way for the same seed."""

import asyncio
import socket
import struct
from collections import Counter
from collections.abc import Callable

import numpy as np

from rigs.hostile_modbus import LoopbackServer


class MaliciousProxy(LoopbackServer):
    """Stands between a reader and a device.

    Parameters
    ----------
    port
        Of the device, on this machine.
    mischief
        How often each of `delay`, `slice`, `coalesce`, `duplicate`, `corrupt`, `corrupt_request`,
        `half_close`, `reset` and `swallow` happens to a piece of the stream, 0 to 1.
    """

    def __init__(self, port: int, seed: int, **mischief: float) -> None:
        super().__init__()
        self.n_done: Counter[str] = Counter()
        self.mischief = mischief
        self._device_port = port
        self._random = np.random.default_rng(seed)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        device_reader, device_writer = await asyncio.open_connection("127.0.0.1", self._device_port)
        ways = [
            asyncio.create_task(self._pump(reader, device_writer, self._request)),
            asyncio.create_task(self._pump(device_reader, writer, self._reply)),
        ]
        try:
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        finally:
            device_writer.close()
            for way in ways:
                way.cancel()
            await asyncio.gather(*ways, return_exceptions=True)

    async def _pump(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, treat: Callable
    ) -> None:
        while data := await reader.read(65_536):
            await treat(data, writer)
            await writer.drain()

    async def _request(self, data: bytes, writer: asyncio.StreamWriter) -> None:
        writer.write(self._turned(data) if self._now("corrupt_request") else data)

    async def _reply(self, data: bytes, writer: asyncio.StreamWriter) -> None:
        if self._now("reset"):
            linger = struct.pack("ii", 1, 0)  # close with a reset instead of an end
            writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
            raise ConnectionResetError
        if self._now("half_close"):
            writer.write_eof()
            await asyncio.Event().wait()
        if self._now("swallow"):
            return
        if self._now("delay"):
            await asyncio.sleep(float(self._random.uniform(0.0, 0.02)))
        if self._now("corrupt"):
            data = self._turned(data)
        if self._now("duplicate"):
            data = data + data
        if self._now("slice"):
            await self._sliced(data, writer)
        elif self._now("coalesce"):
            held, data = data[-3:], data[:-3]
            writer.write(data)
            await asyncio.sleep(0.001)
            writer.write(held)
        else:
            writer.write(data)

    async def _sliced(self, data: bytes, writer: asyncio.StreamWriter) -> None:
        while data:
            n_bytes = int(self._random.integers(1, 1 + len(data)))
            writer.write(data[:n_bytes])
            await writer.drain()
            await asyncio.sleep(0)
            data = data[n_bytes:]

    def _turned(self, data: bytes) -> bytes:
        wrong = bytearray(data)
        for position in self._random.integers(0, len(data), self._random.integers(1, 6)):
            wrong[position] ^= int(self._random.integers(1, 256))
        return bytes(wrong)

    def _now(self, kind: str) -> bool:
        happens = bool(self._random.random() < self.mischief.get(kind, 0.0))
        self.n_done[kind] += happens
        return happens
