"""HTTP server: uvicorn with deadlines, heartbeats and a shutdown in bounded time."""

import asyncio
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import uvicorn

from service.api.http.protocol import STOP_S, Connections, GuardedConfig, GuardedProtocol
from service.runtime.heartbeats import UNHEARD, Pulse

SHUTDOWN_S = 1.0
"""Time after which unfinished requests are cancelled when the server stops, s."""

SWEEP_TICKS = 5
"""Period of the checks of connection deadlines, in uvicorn ticks of 0.1 s."""


class GuardedServer(uvicorn.Server):
    """Uvicorn server with deadlines for connections and without signal handlers."""

    def __init__(self, config: GuardedConfig) -> None:
        super().__init__(config)
        self._guarded = config
        self._pulse: Pulse = UNHEARD

    async def run_on(self, listener: socket.socket, pulse: Pulse) -> None:
        """Serve requests on a listening socket until stopped; send heartbeats to `pulse`."""
        self._pulse = pulse
        await self.serve([listener])

    @property
    def open(self) -> Connections:
        """Open connections of the server."""
        return self._guarded.connections

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen with a time limit for TLS handshakes, which uvicorn does not set."""
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
        """Install no signal handlers; the program handles signals and stops all its parts."""
        yield

    async def on_tick(self, counter: int) -> bool:
        """Send a heartbeat, check connection deadlines; return whether the server must stop."""
        self._pulse.beat()
        if counter % SWEEP_TICKS == 0:
            self.open.sweep()
        return await super().on_tick(counter)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop the server; after `SHUTDOWN_S`, cancel requests and abort all connections."""
        # give up before uvicorn cancels the tasks, which logs a traceback for each
        patience = asyncio.get_running_loop().call_later(SHUTDOWN_S, self._give_up)
        try:
            await super().shutdown(sockets)
        finally:
            patience.cancel()
            self.open.abort_all()

    def _give_up(self) -> None:
        self._guarded.answers.give_up()
        self.open.abort_all()
