"""Receivers on loopback that do as they are told, an outbox on a real file, a clock in hand."""

import asyncio
import itertools
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from harness.waiting import at_work
from rigs.database_copy import copy_database
from rigs.standing_clock import T0, SetClock

from core.alarms.alarm import Alarm, AlarmChange, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.life_cycle import update
from core.limits import AlarmLevel, Judgement
from service.notifications.message import AlarmContext, Composer
from service.notifications.routing import Router
from service.notifications.sender import Receiver, Sender
from service.notifications.webhook import Webhook
from service.settings.notifications import DEFAULT_CHANGES, WebhookSettings
from service.store.sqlite import SqliteStore

PATIENCE_S = 120.0
"""Until a test gives up; none waits that long when all is well."""

ALERT = Judgement(AlarmLevel.ALERT, value=160.25, limit=150.0, reason="above_limit")
DANGER = Judgement(AlarmLevel.DANGER, value=260.0, limit=250.0, reason="above_limit")
WELL = Judgement(value=3.0)


class HandClock(SetClock):
    """Counts how long is waited, and waits for ever where a test holds it."""

    def __init__(self) -> None:
        super().__init__()
        self.slept_s: list[float] = []
        self.held_from_s = 30.0

    async def sleep(self, duration_s: float) -> None:
        self.slept_s.append(duration_s)
        if duration_s >= self.held_from_s:
            await asyncio.Event().wait()
        await super().sleep(duration_s)


def news(number: int, *conditions: Judgement, unit: str = "U1") -> AlarmNews:
    """An alarm of its own that goes through some conditions."""
    alarm, events = Alarm(AlarmIdentity(unit, f"B{number}", "order1_shaft_x")), []
    for step, condition in enumerate(conditions or (ALERT,)):
        alarm, found = update(alarm, condition, T0 + number * 10**9 + step, AlarmRule())
        events += found
    return AlarmNews(alarm, tuple(events))


def desk(url: str = "http://127.0.0.1/", **settings: object) -> WebhookSettings:
    """Return the settings of a receiver."""
    return WebhookSettings.model_validate({"kind": "webhook", "id": "desk", "url": url, **settings})


def route(
    receiver: str, changes: tuple[AlarmChange, ...] = DEFAULT_CHANGES, **wanted: object
) -> WebhookSettings:
    return desk(id=receiver, changes=changes, **wanted)


def composer(prefix: str = "id") -> Composer:
    """Numbers its messages in order."""
    numbers = itertools.count()
    return Composer(
        "Itaipu",
        "https://padwatch.example/",
        {"U1": "Unit 1"},
        lambda _: AlarmContext(),
        lambda: f"{prefix}-{next(numbers)}",
    )


@dataclass
class Request:
    """What a web server was sent."""

    line: str
    headers: dict[str, str]
    body: bytes

    @property
    def id(self) -> str:
        return self.headers["padwatch-event-id"]


Behaviour = Callable[[Request, asyncio.StreamWriter], Awaitable[None]]


def answer(status: str, *headers: str, body: str = "") -> Behaviour:
    """A web server that gives one answer and closes."""

    async def behave(request: Request, writer: asyncio.StreamWriter) -> None:  # noqa: ARG001
        lines = [f"HTTP/1.1 {status}", f"Content-Length: {len(body)}", *headers, "", body]
        writer.write("\r\n".join(lines).encode())

    return behave


@dataclass
class WebServer:
    """A web server; each request is answered by the next behaviour, the last one for ever."""

    behaviours: list[Behaviour]
    requests: list[Request] = field(default_factory=list)
    port: int = 0
    scheme: str = "http"
    came: asyncio.Condition = field(default_factory=asyncio.Condition)

    @property
    def url(self) -> str:
        return f"{self.scheme}://127.0.0.1:{self.port}/alarms?plant=1"

    async def until(self, n_requests: int) -> None:
        async with asyncio.timeout(PATIENCE_S), self.came:
            await self.came.wait_for(lambda: len(self.requests) >= n_requests)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = (await reader.readuntil(b"\r\n\r\n")).decode().split("\r\n")
        headers = dict(line.lower().split(": ", 1) for line in head[1:-2])
        body = await reader.readexactly(int(headers["content-length"]))
        request = Request(head[0], headers, body)
        behave = self.behaviours[min(len(self.requests), len(self.behaviours) - 1)]
        async with self.came:
            self.requests.append(request)
            self.came.notify_all()
        await behave(request, writer)
        await writer.drain()


@asynccontextmanager
async def serving(
    serve: Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]],
    context: ssl.SSLContext | None = None,
) -> AsyncIterator[int]:
    """Serve on a free port; what still runs at the end is cancelled."""
    tasks: set[asyncio.Task[None]] = set()

    def begin(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        async def one() -> None:
            try:
                await serve(reader, writer)
            except (ConnectionError, asyncio.IncompleteReadError):
                pass  # the client has had enough
            finally:
                writer.close()

        task = asyncio.create_task(one())
        tasks.add(task)
        task.add_done_callback(tasks.discard)

    server = await asyncio.start_server(begin, "127.0.0.1", 0, ssl=context)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for task in list(tasks):
            task.cancel()
        if tasks:
            await asyncio.wait(list(tasks))
        await server.wait_closed()


@pytest.fixture
def server_tls(certificate: tuple[Path, Path]) -> ssl.SSLContext:
    """What a server needs for TLS."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(*certificate)
    return context


class Room:
    """Everything that a test of delivery needs: receivers, an outbox, senders, a clock in hand."""

    answers = staticmethod(answer)
    news = staticmethod(news)
    routed = staticmethod(route)
    settings = staticmethod(desk)
    serving = staticmethod(serving)

    def __init__(self, path: Path, stack: AsyncExitStack) -> None:
        self.clock = HandClock()
        self.path, self._stack = path, stack

    @staticmethod
    def running(*senders: Sender) -> AbstractAsyncContextManager[None]:
        """Let senders run for a while; an error of one fails the test."""
        return at_work(*(sender.run() for sender in senders))

    async def web(self, *behaviours: Behaviour, context: ssl.SSLContext | None = None) -> WebServer:
        """Start a web server."""
        server = WebServer(list(behaviours), scheme="https" if context else "http")
        server.port = await self._stack.enter_async_context(serving(server.serve, context))
        return server

    def open_store(self, *routes: WebhookSettings, prefix: str = "id") -> SqliteStore:
        """Open the database; the same one each time, with the receivers of the moment."""
        router = Router(routes or [route("desk")], composer(prefix), self.clock.now_ns)
        store = SqliteStore(self.path, address=router)
        self._stack.callback(store.close)
        return store

    def sender(
        self, server: WebServer, store: SqliteStore, name: str = "desk", **changes: object
    ) -> Sender:
        """Make the sender of a receiver that is told by a webhook."""
        keys = ("connect_timeout_s", "answer_timeout_s", "total_timeout_s")
        settings = desk(server.url, **(dict.fromkeys(keys, 20.0) | changes))
        receiver = Receiver(name, settings, Webhook(settings, self.clock))
        return Sender(receiver, store.outbox, self.clock)

    async def settled(self, sender: Sender, store: SqliteStore) -> None:
        """Wait until nothing waits for a receiver any more."""
        async with asyncio.timeout(PATIENCE_S):
            while store.outbox.waiting(sender.receiver.name, 1):
                await asyncio.sleep(0.01)

    async def delivered(self, server: WebServer, store: SqliteStore, **changes: object) -> Sender:
        """Let a sender work until nothing waits for its receiver any more."""
        sender = self.sender(server, store, **changes)  # type: ignore[arg-type]
        async with self.running(sender):
            await self.settled(sender, store)
        return sender

    @staticmethod
    def letters(store: SqliteStore) -> list[tuple[str, str, int, str]]:
        """Every letter there ever was: event, state, attempts in vain and answer, by number."""
        with store._reader() as reader:
            columns = "event_id, state, n_attempts, answer"
            return reader.execute(f"SELECT {columns} FROM outbox ORDER BY id").fetchall()  # noqa: S608


@pytest.fixture
async def room(database_file: Path, folder_in_memory: Path) -> AsyncIterator[Room]:
    async with AsyncExitStack() as stack:
        yield Room(copy_database(database_file, folder_in_memory), stack)
