"""Connections that no flood comes through: an answer is read in small pieces, and not for ever.

A server that sends one interim answer after the other, or headers without end, would otherwise keep
the event loop busy with parsing for as long as the time-out of an attempt allows.
"""

import asyncio
import ssl
from collections.abc import Iterable
from typing import Any

import httpcore2

from acquisition.delivery.network import NameLookUp

PIECE_BYTES = 1024
"""Most that is parsed without giving the event loop to others."""

MAX_BYTES = 32_768
"""Most that is read of one answer, headers included."""

SocketOption = (
    tuple[int, int, int] | tuple[int, int, bytes | bytearray] | tuple[int, int, None, int]
)


class BoundedStream(httpcore2.AsyncNetworkStream):
    """A connection of which at most so much is read.

    Parameters
    ----------
    n_left
        Bytes that may still be read.
    """

    def __init__(self, stream: httpcore2.AsyncNetworkStream, n_left: int = MAX_BYTES) -> None:
        self._stream, self._n_left = stream, n_left

    async def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        """Read a piece.

        Raises
        ------
        httpcore2.ReadError
            If there was too much already.
        """
        if self._n_left <= 0:
            raise httpcore2.ReadError(f"the answer is longer than {MAX_BYTES} bytes")
        found = await self._stream.read(min(max_bytes, PIECE_BYTES), timeout)
        self._n_left -= len(found)
        await asyncio.sleep(0)  # what has been received already is handed out without waiting
        return found

    async def write(self, buffer: bytes, timeout: float | None = None) -> None:
        """Send."""
        await self._stream.write(buffer, timeout)

    async def aclose(self) -> None:
        """Close."""
        await self._stream.aclose()

    async def start_tls(
        self,
        ssl_context: ssl.SSLContext,
        server_hostname: str | None = None,
        timeout: float | None = None,
    ) -> httpcore2.AsyncNetworkStream:
        """Encrypt."""
        encrypted = await self._stream.start_tls(ssl_context, server_hostname, timeout)
        return BoundedStream(encrypted, self._n_left)

    def get_extra_info(self, info: str) -> Any:
        """What the connection beneath knows of itself."""
        return self._stream.get_extra_info(info)


class BoundedNetwork(httpcore2.AsyncNetworkBackend):
    """Connects to a name by its own look-up."""

    def __init__(self, look_up: NameLookUp) -> None:
        self._look_up, self._network = look_up, httpcore2.AnyIOBackend()

    async def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[SocketOption] | None = None,
    ) -> httpcore2.AsyncNetworkStream:
        """Connect to the first address that answers.

        Raises
        ------
        OSError
            If the name has no address.
        httpcore2.ConnectError, httpcore2.ConnectTimeout
            If none of its addresses answers.
        """
        failure: Exception = httpcore2.ConnectError(f"{host} has no address")
        async with asyncio.timeout(timeout):
            addresses = await self._look_up.addresses()
        for address in addresses:
            try:
                stream = await self._network.connect_tcp(
                    address, port, timeout, local_address, socket_options
                )
            except (httpcore2.ConnectError, httpcore2.ConnectTimeout) as error:
                failure = error
            else:
                return BoundedStream(stream)
        raise failure
