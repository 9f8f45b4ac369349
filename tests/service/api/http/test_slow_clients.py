"""A client that never finishes does not stay, and takes nobody's place while it is there."""

import asyncio
import socket
import ssl
from pathlib import Path

import pytest
from rigs.tiers import covering
from starlette.responses import PlainTextResponse

from service.api.http.listening import server_tls
from service.api.http.protocol import GuardedConfig
from service.api.http.server import GuardedServer
from service.settings.processes import HttpLimitSettings

LARGE_MIB = 64


@pytest.mark.parametrize(
    ("sent", "counter", "more", "status"),
    [
        (b"GET / HTTP/1.1\r\nHost: localhost\r\nX-A: ", "_n_wire", b"b", 408),  # buys no time
        (b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 10\r\n\r\n12345", "_n_body", b"", 408),
        (b"", "_n_wire", b"", 0),  # closed without a word
    ],
)
async def test_headers_or_a_body_that_never_come_or_end_are_given_up(
    start, sent: bytes, counter: str, more: bytes, status: int
) -> None:
    running = await start(["a"])
    client = await running.client()
    await client.send(sent)
    connection = running.connection()
    await running.until(lambda: getattr(connection, counter) >= bool(sent))

    running.pass_time(3.9)
    await client.send(more)
    running.pass_time(0.2)

    assert await client.status() == status
    assert await client.is_closed()
    assert running.app.n_asked == 0


async def test_empty_lines_between_requests_buy_no_time(running) -> None:
    client = await running.ask()
    assert await client.status() == 200

    await client.send(b"\r\n\r\n")
    running.pass_time(8.1)

    assert await client.is_closed()


async def test_a_service_that_stalls_blames_no_client(running) -> None:
    client = await running.client()

    running.pass_time(2.0)
    running.now_s += 60.0
    running.server.open.sweep()
    await client.send(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")

    assert await client.status() == 200


async def test_one_who_does_not_read_his_answer_is_closed(running) -> None:
    client = await running.ask("/large")
    connection = running.connection()
    await running.until(lambda: connection.n_unsent() > 0)

    running.pass_time(7.9)
    assert len(running.server.open) == 1
    running.pass_time(0.2)

    await running.until(lambda: len(running.server.open) == 0)
    client.writer.close()


async def test_an_answer_that_is_read_slowly_but_steadily_arrives(running) -> None:
    client = await running.ask("/large")
    await client.reader.readuntil(b"\r\n\r\n")
    n_read = 0

    for _ in range(8):
        n_read += len(await client.reader.readexactly(8 * 1024 * 1024))
        running.pass_time(7.0)

    assert n_read == LARGE_MIB * 1024 * 1024


async def test_work_on_an_answer_is_not_held_against_the_client(running) -> None:
    client = await running.ask("/slow")
    await running.until(lambda: running.app.n_asked == 1)

    running.pass_time(100.0)
    running.app.goes_on.set()

    assert await client.status() == 200


async def test_a_good_client_is_served_beside_five_hundred_idle_ones(running) -> None:
    idle = [await running.client() for _ in range(500)]

    for _ in range(20):
        client = await running.ask()
        assert await client.status() == 200
    assert len(running.server.open) <= running.server.open.limits.max_connections_per_peer + 1

    running.pass_time(10.0)
    await running.until(lambda: len(running.server.open) == 0)
    assert all([await client.is_closed() for client in idle])


async def test_the_longest_silent_connection_makes_room(start) -> None:
    running = await start(max_connections_per_peer=3)
    asked = await running.ask()
    assert await asked.status() == 200
    running.now_s = 1.0
    first = await running.client()
    running.now_s = 2.0
    second = await running.client()

    third = await running.ask()

    assert await third.status() == 200
    assert await first.is_closed()
    await second.send(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert await second.status() == 200


async def test_without_a_silent_connection_a_new_one_is_refused(start) -> None:
    running = await start(max_connections=2, max_connections_per_peer=2)
    slow = [await running.ask("/slow") for _ in range(2)]
    await running.until(lambda: running.app.n_asked == 2)

    late = await running.ask()

    assert await late.status() == 503
    assert b"retry-after: 5" in late.head
    running.app.goes_on.set()
    assert [await client.status() for client in slow] == [200, 200]


async def test_bodies_under_way_take_no_place_of_requests(start) -> None:
    running = await start(max_requests=1)
    for _ in range(20):
        await running.ask("/", "POST", "Content-Length: 10\r\n")

    good = await running.ask()

    assert await good.status() == 200


async def test_one_request_too_many_is_told_to_come_again(start) -> None:
    running = await start(max_requests=1)
    slow = await running.ask("/slow")
    await running.until(lambda: running.app.n_asked == 1)

    second = await running.ask()
    assert await second.status() == 503
    assert b"retry-after: 1" in second.head

    running.app.goes_on.set()
    assert await slow.status() == 200
    assert await (await running.ask()).status() == 200


async def test_an_answer_that_does_not_come_is_given_up(start) -> None:
    running = await start(answer_s=1.0)
    client = await running.ask("/slow")
    await running.until(lambda: running.app.asker is not None)
    assert not running.app.asker.has_gone

    assert await client.status() == 503
    assert b"timed out" in client.body
    assert running.app.asker.has_gone  # and so is what threads still read


@pytest.mark.parametrize("what", ["silent", "head", "body", "unread", "unanswered"])
async def test_the_server_stops_whatever_clients_do(running, what: str, caplog) -> None:
    client = await running.client()
    said = {
        "silent": b"",
        "head": b"GET / HTTP/1.1\r\nHo",
        "body": b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\n1",
        "unread": b"GET /large HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "unanswered": b"GET /slow HTTP/1.1\r\nHost: localhost\r\n\r\n",
    }[what]
    await client.send(said)
    if what == "unread":
        connection = running.connection()
        await running.until(lambda: connection.n_unsent() > 0)
    if what == "unanswered":
        await running.until(lambda: running.app.n_asked == 1)

    running.server.should_exit = True
    await running.serving

    assert len(running.server.open) == 0
    assert not any(record.exc_info for record in caplog.records)


PATIENCE_S = 30.0


@pytest.fixture
def tls(certificate: tuple[Path, Path]) -> ssl.SSLContext:
    return server_tls(*certificate)


SENT = [b"", b"\x16\x03\x01\x02\x00", b"GET / HTTP/1.1\r\n\r\n"]


@pytest.mark.parametrize(("said", "is_stopped"), covering(SENT, [False, True]))
async def test_a_handshake_that_never_ends_is_given_up(
    tls: ssl.SSLContext, said: bytes, is_stopped: bool
) -> None:
    limits = HttpLimitSettings(head_s=60.0 if is_stopped else 0.5)
    app, listener = PlainTextResponse("here"), socket.create_server(("127.0.0.1", 0))
    config = GuardedConfig(app, limits, [], lambda: 0.0, ssl_context_factory=lambda *_: tls)
    server = GuardedServer(config)
    async with asyncio.timeout(PATIENCE_S):
        serving = asyncio.create_task(server.serve([listener]))
        reader, writer = await asyncio.open_connection(*listener.getsockname())
        writer.write(said)
        good = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        good.check_hostname, good.verify_mode = False, ssl.CERT_NONE
        asking, answer = await asyncio.open_connection(*listener.getsockname(), ssl=good)
        answer.write(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        assert b"200" in await asking.readline()
        answer.close()
        if not is_stopped:
            while await reader.read(100):
                pass
        server.should_exit = True
        await serving
        writer.close()
