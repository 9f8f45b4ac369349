"""A real server on a free port of loopback, and raw clients."""

import asyncio
import socket
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field

import pytest
from fastapi import Depends, Request, Response
from pydantic import BaseModel

from service.api.app import GuardedApi
from service.api.auth.gate import OPEN, declared
from service.api.problems import install_problem_handlers, refuse_unknown_parameters
from service.api.server import HttpServer, http_server
from service.runtime.asker import ASKER, Asker
from service.settings.processes import HttpLimitSettings

PATIENCE_S = 120.0
"""Ends a test that would hang; none waits for it otherwise."""

LARGE = b"x" * 64 * 1024 * 1024
"""More than the buffers of a connection hold."""


class Posted(BaseModel, extra="forbid"):
    """Body of a request."""

    text: str


@dataclass
class Application:
    """Routes that take a body or none; some are slow or large."""

    n_asked: int = 0
    method: str = ""
    asker: Asker | None = None
    goes_on: asyncio.Event = field(default_factory=asyncio.Event)

    def app(self) -> GuardedApi:
        app = GuardedApi()
        install_problem_handlers(app)
        checks = [OPEN, Depends(refuse_unknown_parameters)]
        app.add_api_route("/", self.hello, dependencies=checks)
        app.add_api_route("/", self.post, methods=["POST"], dependencies=checks)
        app.add_api_route("/slow", self.slow, dependencies=checks)
        app.add_api_route("/large", self.large, dependencies=checks)
        app.declared = declared(app)
        return app

    async def hello(self, request: Request) -> Response:
        self.n_asked, self.method = self.n_asked + 1, request.method
        return Response("here")

    async def post(self, posted: Posted) -> Response:
        self.n_asked += 1
        return Response(f"{len(posted.text)} characters")

    async def slow(self) -> Response:
        self.n_asked += 1
        self.asker = await asyncio.to_thread(ASKER.get)
        await self.goes_on.wait()
        return Response("late")

    async def large(self) -> Response:
        self.n_asked += 1
        return Response(LARGE)


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


@dataclass
class Running:
    """A server under test."""

    app: Application
    server: HttpServer
    port: int
    clients: AsyncExitStack
    serving: asyncio.Future[None] = field(default_factory=asyncio.Future)

    async def client(self) -> Client:
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        self.clients.callback(writer.close)
        return Client(reader, writer)

    async def ask(self, target: str = "/", method: str = "GET", head: str = "") -> Client:
        client = await self.client()
        await client.send(f"{method} {target} HTTP/1.1\r\nHost: localhost\r\n{head}\r\n".encode())
        return client

    async def until(self, is_so: Callable[[], bool]) -> None:
        while not is_so():
            await asyncio.sleep(0.001)


Start = Callable[..., Awaitable[Running]]


@asynccontextmanager
async def running(limits: HttpLimitSettings, tls: ssl.SSLContext | None) -> AsyncIterator[Running]:
    app = Application()
    async with AsyncExitStack() as clients:
        listener = socket.create_server(("127.0.0.1", 0))
        server = http_server(app.app(), limits, [], tls=tls)
        state = Running(app, server, listener.getsockname()[1], clients)
        state.serving = asyncio.create_task(server.run_on(listener))
        await state.until(lambda: server.started)
        try:
            async with asyncio.timeout(PATIENCE_S):
                yield state
        finally:
            app.goes_on.set()
            server.should_exit = True
            await state.serving


@pytest.fixture
async def start() -> AsyncIterator[Start]:
    """Starts a server with its own limits."""
    async with AsyncExitStack() as stack:

        async def begin(tls: ssl.SSLContext | None = None, **limits: object) -> Running:
            settings = HttpLimitSettings.model_validate(limits)
            return await stack.enter_async_context(running(settings, tls))

        yield begin


@pytest.fixture(name="running")
async def running_server(start: Start) -> Running:
    """A server with the limits of a plant."""
    return await start()
