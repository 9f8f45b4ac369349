"""A real server on a free port of loopback, with a clock that tests set, and raw clients."""

import asyncio
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field

import pytest
from starlette.types import Receive, Scope, Send

from service.api.http.protocol import GuardedConfig, GuardedProtocol
from service.api.http.server import GuardedServer
from service.runtime.asker import ASKER, Asker
from service.settings.processes import HttpLimitSettings

PATIENCE_S = 20.0
"""Ends a test that would hang; none waits for it otherwise."""

LARGE = b"x" * 64 * 1024 * 1024
"""More than the buffers of a connection hold."""


@dataclass
class Application:
    """Answers with the length of the body; some paths are slow or large."""

    n_asked: int = 0
    method: str = ""
    asker: Asker | None = None
    goes_on: asyncio.Event = field(default_factory=asyncio.Event)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.n_asked += 1
        self.method = scope["method"]
        self.asker = await asyncio.to_thread(ASKER.get)
        message = await receive()
        text = b"%d bytes" % len(message["body"])
        if scope["path"] == "/slow":
            await self.goes_on.wait()
        if scope["path"] == "/large":
            text = LARGE
        headers = [(b"content-length", b"%d" % len(text))]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": text})


@dataclass
class Client:
    """One raw connection."""

    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter

    async def send(self, data: bytes) -> None:
        self.writer.write(data)
        await self.writer.drain()

    async def status(self) -> int:
        """Status of the next answer; 0 if the connection is closed instead."""
        try:
            head = await self.reader.readuntil(b"\r\n\r\n")
        except (asyncio.IncompleteReadError, ConnectionError):
            return 0
        self.head = head.lower()
        length = int(self.head.partition(b"content-length: ")[2].partition(b"\r")[0])
        self.body = await self.reader.readexactly(length)
        return int(head.split()[1])

    async def is_closed(self) -> bool:
        """Wait for the end of the connection."""
        try:
            return await self.reader.read() == b""
        except ConnectionError:
            return True


@dataclass
class Running:
    """A server under test."""

    app: Application
    server: GuardedServer
    port: int
    clients: AsyncExitStack
    now_s: float = 0.0
    serving: asyncio.Future[None] = field(default_factory=asyncio.Future)

    async def client(self) -> Client:
        n_before = self.server.open.n_accepted
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        self.clients.callback(writer.close)
        while self.server.open.n_accepted == n_before:
            await asyncio.sleep(0)
        return Client(reader, writer)

    async def ask(self, target: str = "/", method: str = "GET", head: str = "") -> Client:
        client = await self.client()
        await client.send(f"{method} {target} HTTP/1.1\r\nHost: localhost\r\n{head}\r\n".encode())
        return client

    async def until(self, is_so: Callable[[], bool]) -> None:
        while not is_so():
            await asyncio.sleep(0)

    def connection(self) -> GuardedProtocol:
        """The only connection there is."""
        (only,) = self.server.open.all()
        assert isinstance(only, GuardedProtocol)
        return only

    def pass_time(self, seconds: float) -> None:
        """Let time pass for the server; it looks at its connections by itself too."""
        self.server.open.sweep()
        until_s = self.now_s + seconds
        while self.now_s < until_s:
            self.now_s = min(self.now_s + 0.5, until_s)
            self.server.open.sweep()


Start = Callable[..., Awaitable[Running]]


@asynccontextmanager
async def running(limits: HttpLimitSettings, hosts: list[str]) -> AsyncIterator[Running]:
    app = Application()
    async with AsyncExitStack() as clients:
        listener = socket.create_server(("127.0.0.1", 0))
        state = Running(app, None, listener.getsockname()[1], clients)  # type: ignore[arg-type]
        config = GuardedConfig(app, limits, hosts, lambda: state.now_s)
        state.server = GuardedServer(config)
        state.serving = asyncio.create_task(state.server.serve([listener]))
        while not state.server.started:
            await asyncio.sleep(0)
        try:
            async with asyncio.timeout(PATIENCE_S):
                yield state
        finally:
            app.goes_on.set()
            state.server.should_exit = True
            await state.serving


@pytest.fixture
async def start() -> AsyncIterator[Start]:
    """Starts a server with its own limits."""
    async with AsyncExitStack() as stack:

        async def begin(hosts: list[str] | None = None, **limits: object) -> Running:
            settings = HttpLimitSettings.model_validate(limits)
            return await stack.enter_async_context(running(settings, hosts or []))

        yield begin


@pytest.fixture(name="running")
async def running_server(start: Start) -> Running:
    """A server with the limits of a plant."""
    return await start()
