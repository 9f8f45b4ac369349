"""The HTTP server: watches its connections while it runs, and leaves none when it stops."""

import asyncio
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import uvicorn

from service.api.http.connections import Connections
from service.api.http.protocol import STOP_S, GuardedConfig, GuardedProtocol
from service.runtime.heartbeats import UNHEARD, Pulse

PATIENCE_S = 1.0
"""What clients get to finish in when the server stops."""

SWEEP_TICKS = 5
"""Connections are looked at every so many of uvicorn's ticks of 0.1 s."""


class GuardedServer(uvicorn.Server):
    """Uvicorn without its own signal handling: the program stops all its parts together."""

    def __init__(self, config: GuardedConfig) -> None:
        super().__init__(config)
        self._guarded = config
        self._pulse: Pulse = UNHEARD

    async def run_on(self, listener: socket.socket, pulse: Pulse) -> None:
        """Serve until it is told to stop."""
        self._pulse = pulse
        await self.serve([listener])

    @property
    def open(self) -> Connections:
        """The open connections."""
        return self._guarded.connections

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen; uvicorn's own would let a client take a minute for its TLS handshake."""
        if self.config.ssl is None:
            await super().startup(sockets)
            return
        await self.lifespan.startup()
        loop = asyncio.get_running_loop()
        self.servers = [
            await loop.create_server(
                self._connection,
                sock=listener,
                ssl=self.config.ssl,
                backlog=self.config.backlog,
                ssl_handshake_timeout=self.open.limits.head_s,
                ssl_shutdown_timeout=STOP_S,
            )
            for listener in sockets or ()
        ]
        self.started = True

    def _connection(self) -> asyncio.Protocol:
        return GuardedProtocol(self._guarded, self.server_state, self.lifespan.state)

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave the signals alone."""
        yield

    async def on_tick(self, counter: int) -> bool:
        """Beat ten times a second, and look at all connections now and then."""
        self._pulse.beat()
        if counter % SWEEP_TICKS == 0:
            self.open.sweep()
        return await super().on_tick(counter)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Close everything in time; who does not read his answer is not waited for to the end."""
        # before uvicorn cancels the tasks, which would log a traceback for each
        patience = asyncio.get_running_loop().call_later(PATIENCE_S, self._give_up)
        try:
            await super().shutdown(sockets)
        finally:
            patience.cancel()
            self.open.abort_all()

    def _give_up(self) -> None:
        self._guarded.answers.give_up()
        self.open.abort_all()
