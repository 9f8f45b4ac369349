"""The server of the health page."""

import asyncio
import socket
from functools import partial

from acquisition.clock import Clock
from service.api.http.protocol import GuardedConfig
from service.api.http.server import GuardedServer
from service.app.health.page import Health, health_app
from service.runtime.heartbeats import Heartbeats
from service.settings.http_limits import HttpLimitSettings

HOST = "127.0.0.1"
"""Whoever else wants to know asks a proxy or an agent on the same computer."""


class HealthServer:
    """Serves the health page on a socket."""

    def __init__(self, health: Health, listener: socket.socket, clock: Clock) -> None:
        config = GuardedConfig(health_app(health), HttpLimitSettings(), [HOST], clock.monotonic_s)
        self._server, self._listener = GuardedServer(config), listener

    def start(self, tasks: asyncio.TaskGroup, beats: Heartbeats) -> asyncio.Task[None]:
        """Begin to serve; ends after `stop`."""
        serve = partial(self._server.run_on, self._listener)
        return tasks.create_task(beats.tend("health", serve), name="health")

    async def started(self) -> None:
        """Wait until it answers."""
        while not self._server.started:
            await asyncio.sleep(0.01)

    def stop(self) -> None:
        """Take no more requests."""
        self._server.should_exit = True
