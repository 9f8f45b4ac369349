"""What is no proper request, or has no proper body, ends in a 4xx with constant words."""

import json
import tomllib
import tracemalloc
from pathlib import Path

import httpx2
import pytest
from starlette.responses import PlainTextResponse

from acquisition.clock import SystemClock
from service.app.web import server_of
from service.settings.plant import PlantFile

GET = b"GET / HTTP/1.1\r\nHost: localhost\r\n"
POST = b"POST / HTTP/1.1\r\nHost: localhost\r\n"
CHUNKED = POST + b"Transfer-Encoding: chunked\r\n"


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 400),
        (b"GET / HTTP/9.9\r\nHost: localhost\r\n\r\n", 400),
        (b"GET /\xff\xfe HTTP/1.1\r\nHost: localhost\r\n\r\n", 400),
        (b"GET http://evil.example/ HTTP/1.1\r\nHost: localhost\r\n\r\n", 400),
        (b"CONNECT localhost:22 HTTP/1.1\r\nHost: localhost\r\n\r\n", 400),
        (b"GET / HTTP/1.1\r\n\r\n", 400),
        (GET + b"Host: localhost\r\n\r\n", 400),
        (b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n", 421),
        (b"GET / HTTP/1.1\r\nHost: localhost.evil.example:80\r\n\r\n", 421),
        (b"GET / HTTP/1.1\r\nHost: localhost@evil.example\r\n\r\n", 421),
        (b"GET /" + b"%01" * 2600 + b" HTTP/1.1\r\nHost: evil.example\r\n\r\n", 421),
        (b"GET /" + b"a" * 9000 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n", 414),
        (GET + b"X: " + b"a" * 17_000 + b"\r\n\r\n", 431),
        (GET + b"X: a\r\n" * 4000 + b"\r\n", 431),
        (GET + b"X: " + b"a" * 300_000, 431),
        (POST + b"Content-Length: -1\r\n\r\n", 400),
        (POST + b"Content-Length: 1\r\nContent-Length: 2\r\n\r\n", 400),
        (POST + b"Content-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 400),
        (CHUNKED + b"\r\nz\r\n", 400),
        (CHUNKED + b"\r\n0\r\nTrailer: x\r\n\r\n", 400),
        (POST + b"Content-Length: 209715200\r\n\r\n", 413),
        (POST + b"Content-Length: 9" + b"9" * 18 + b"\r\n\r\n", 413),
    ],
)
async def test_a_bad_request_is_refused(running, request_: bytes, status: int, caplog) -> None:
    client = await running.client()

    await client.send(request_)

    assert await client.status() == status
    problem = json.loads(client.body)
    assert problem["status"] == status
    assert len(client.body) <= 2048
    assert b"content-type: application/problem+json" in client.head
    assert b"x-content-type-options: nosniff" in client.head
    assert running.app.n_asked == 0
    assert not caplog.records


async def test_head_is_answered_as_get_without_the_body(running) -> None:
    client = await running.ask("/", "HEAD")

    assert (await client.reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 200")
    assert running.app.method == "GET"
    await client.send(GET + b"\r\n")
    assert await client.status() == 200  # of the next one: there was nothing between
    assert client.body == b"0 bytes"


async def test_a_long_header_in_small_pieces_is_refused(running) -> None:
    client = await running.client()
    await client.send(GET + b"X: ")
    for _ in range(100):
        await client.send(b"a" * 1000)
        if running.server.open.limits and len(running.server.open) == 0:
            break

    assert await client.status() == 431


async def test_many_requests_ahead_are_answered_in_order_and_no_further(running) -> None:
    client = await running.client()
    await client.send((GET + b"\r\n") * 5000)

    statuses = []
    while status := await client.status():
        statuses.append(status)

    assert set(statuses) == {200}
    assert len(statuses) == 9
    assert running.app.n_asked == 9


async def test_an_upgrade_is_answered_as_a_plain_request(running, caplog) -> None:
    client = await running.ask("/", head="Connection: Upgrade\r\nUpgrade: h2c\r\n")

    assert await client.status() == 200
    assert await client.is_closed()
    assert not caplog.records


DEMO = Path(__file__).parents[4] / "deploy" / "demo.toml"


async def asked(host: str, came_to: str = "127.0.0.1") -> int:
    """Status for a request to an address by a name, of a plant with names of its own."""
    read = tomllib.loads(DEMO.read_text(encoding="utf-8"))
    read.setdefault("service", {})["hosts"] = ["watch.plant.example"]
    read["delivery"] = {"dashboard_url": "https://people.plant.example:8443/"}
    plant = PlantFile.model_validate(read)
    app = server_of(PlainTextResponse("here"), plant, SystemClock()).config.app
    transport = httpx2.ASGITransport(app)
    async with httpx2.AsyncClient(transport=transport, base_url=f"http://{came_to}/") as client:
        return (await client.get("/", headers={"Host": host})).status_code


async def test_a_plant_s_service_answers_to_its_names_and_to_no_other() -> None:
    for host in (
        *("localhost", "127.0.0.1:8080", "[::1]", "LocalHost:1"),
        *("watch.plant.example", "Watch.Plant.Example.:443", "people.plant.example:8443"),
    ):
        assert await asked(host) == 200, host
    for host in ("plant.example", "evil.example", "x.localhost", "[]", ":80"):
        assert await asked(host) == 421, host
    for host in ("127.0.0.1:8231@evil", "127.0.0.1:abc", "localhost:123456", "[::1]evil"):
        assert await asked(host) == 421, host


async def test_the_address_a_client_came_to_is_a_name_too() -> None:
    assert await asked("10.0.0.7:8080", came_to="10.0.0.7") == 200
    assert await asked("10.0.0.7") == 421


MIB = 1024 * 1024


async def test_a_body_arrives_whole(running) -> None:
    client = await running.ask("/", "POST", "Transfer-Encoding: chunked\r\n")
    for _ in range(3):
        await client.send(b"4\r\nabcd\r\n")
    await client.send(b"0\r\n\r\n")

    assert await client.status() == 200
    assert client.body == b"12 bytes"


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b'{"a": "\xff\xfe"}', 400),
        (b'{"a": "\xed\xa0\x80"}', 400),
        (b"[" * 30_000 + b"]" * 30_000, 400),
        (b'{"a":' * 17 + b"1" + b"}" * 17, 400),
        (b"[" * 16 + b"]" * 16, 200),
        (b'{"a": "' + b"[" * 30 + b'", "b": [1, {"c": []}]}', 200),
        (b'["\\"' + b"[" * 30 + b'"]', 200),
        (b'"' + b'\\"' * 30_000 + b'"', 200),  # made to be slow
        (b"]" * 9 + b"[" * 17, 200),
        (b"a" * 64 * 1024, 200),
        (b"a" * (64 * 1024 + 1), 413),
    ],
)
async def test_a_bad_body_is_refused(running, body: bytes, status: int) -> None:
    client = await running.ask("/", "POST", f"Content-Length: {len(body)}\r\n")
    await client.send(body)

    assert await client.status() == status
    assert running.app.n_asked == (status == 200)


@pytest.mark.parametrize("is_chunked", [False, True])
async def test_two_hundred_mebibytes_cost_no_memory(running, is_chunked: bool) -> None:
    head = "Transfer-Encoding: chunked\r\n" if is_chunked else f"Content-Length: {200 * MIB}\r\n"
    piece = b"%x\r\n%s\r\n" % (MIB, b"a" * MIB) if is_chunked else b"a" * MIB
    client = await running.ask("/", "POST", head)
    tracemalloc.start()
    try:
        for _ in range(200):
            await client.send(piece)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()

    assert await client.status() == 413
    assert peak < 10 * MIB
    assert running.app.n_asked == 0


@pytest.mark.parametrize(
    ("sent", "status", "after_s"),
    [
        (b"10000\r\n" + b"a" * 65536 + b"\r\n1\r\na\r\n", 413, 4.1),
        (b"1;a=" + b"b" * 300_000, 400, 0.0),
    ],
)
async def test_chunks_without_end_are_cut_off(
    running, sent: bytes, status: int, after_s: float
) -> None:
    client = await running.ask("/", "POST", "Transfer-Encoding: chunked\r\n")
    await client.send(sent)
    assert await client.status() == status
    running.pass_time(after_s)
    assert await client.is_closed()
