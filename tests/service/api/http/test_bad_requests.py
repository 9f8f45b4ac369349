"""Bad requests end in a short 4xx answer, and in a problem document where uvicorn allows it."""

import json
import tomllib
import tracemalloc
from pathlib import Path

import httpx2
import pytest
from starlette.responses import PlainTextResponse

from service.app.serving_process import server_of
from service.settings.plant import PlantFile
from service.settings.storage import Origin

GET = b"GET / HTTP/1.1\r\nHost: localhost\r\n"
POST = b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
CHUNKED = POST + b"Transfer-Encoding: chunked\r\n"


def posted(body: bytes) -> bytes:
    return POST + b"Content-Length: %d\r\n\r\n%s" % (len(body), body)


THOUSANDS = json.dumps({f"{number:x}": 1 for number in range(1500)}).encode()


@pytest.mark.parametrize(
    ("request_", "status", "said"),
    [
        (b"GET / HTTP/1.1\r\n\r\n", 400, "exactly one Host"),
        (GET + b"Host: localhost\r\n\r\n", 400, "exactly one Host"),
        (b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n", 421, "not a name of this service"),
        (b"GET / HTTP/1.1\r\nHost: localhost.evil.example:80\r\n\r\n", 421, "not a name"),
        (b"GET / HTTP/1.1\r\nHost: localhost@evil.example\r\n\r\n", 421, "not a name"),
        (b"GET / HTTP/1.1\r\nHost: [\r\n\r\n", 421, "not a name"),
        (b"GET /" + b"%01" * 2600 + b" HTTP/1.1\r\nHost: evil.example\r\n\r\n", 421, "not a name"),
        (POST + b"Content-Length: 209715200\r\n\r\n", 413, "larger than 16 KiB"),
        (POST + b"Content-Length: 9" + b"9" * 18 + b"\r\n\r\n", 413, "larger than 16 KiB"),
        (CHUNKED + b"\r\n5000\r\n" + b"a" * 0x5000 + b"\r\n", 413, "larger than 16 KiB"),
        (GET + b"Content-Length: 2\r\n\r\n{}", 400, "takes no body"),
        (GET + b"Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 400, "takes no body"),
        (posted(b'{"text": "\xff\xfe"}'), 400, "must be JSON in UTF-8"),
        (posted(b"[" * 8_000 + b"]" * 8_000), 400, "must be JSON in UTF-8"),
        (posted(b'{"text":' * 1_500 + b"1" + b"}" * 1_500), 400, "must be JSON in UTF-8"),
        (posted(b'{"text":' * 100 + b"1" + b"}" * 100), 422, "valid string"),
        (posted(b'{"text": NaN}'), 422, "valid string"),
        (posted(b"{"), 422, ""),
        (posted(b"{}"), 422, "text: required, but missing"),
        (posted(THOUSANDS), 422, "and 1493 more"),
        (b"GET /nothing HTTP/1.1\r\nHost: localhost\r\n\r\n", 404, "no such address"),
        (b"GET /?nothing=1 HTTP/1.1\r\nHost: localhost\r\n\r\n", 422, "unknown parameter"),
    ],
)
async def test_a_bad_request_gets_a_problem_document(running, request_, status, said, caplog):
    client = await running.client()

    await client.send(request_)

    assert await client.status() == status
    problem = json.loads(client.body)
    assert problem["status"] == status
    assert said in problem["detail"]
    assert len(client.body) <= 2048
    assert b"content-type: application/problem+json" in client.head
    assert b"x-content-type-options: nosniff" in client.head
    assert running.app.n_asked == 0
    assert not caplog.records


@pytest.mark.parametrize(
    "request_",
    [
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
        b"GET / HTTP/9.9\r\nHost: localhost\r\n\r\n",
        b"GET /\xff\xfe HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"CONNECT localhost:22 HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\nHost: localhost\n\n",
        GET + b"X: a\r\n b\r\n\r\n",
        POST + b"Content-Length: -1\r\n\r\n",
        POST + b"Content-Length: 1\r\nContent-Length: 2\r\n\r\n",
        POST + b"Content-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
        CHUNKED + b"\r\nz\r\n",
    ],
)
async def test_what_is_no_http_is_refused_by_the_parser(running, request_, caplog):
    client = await running.client()

    await client.send(request_)

    answer = await client.reader.read()
    assert answer.startswith(b"HTTP/1.1 400 ")
    assert len(answer) < 1000
    assert running.app.n_asked == 0
    assert not caplog.records


async def test_a_body_is_taken_whole_or_in_chunks(running):
    client = await running.client()
    await client.send(posted(b'{"text": "' + b"a" * 16_000 + b'"}'))
    assert await client.status() == 200
    assert client.body == b"16000 characters"

    await client.send(CHUNKED + b"\r\n")
    for piece in (b'{"text', b'": "four"', b"}"):
        await client.send(b"%x\r\n%s\r\n" % (len(piece), piece))
    await client.send(b"0\r\n\r\n")
    assert await client.status() == 200
    assert client.body == b"4 characters"


async def test_head_is_answered_as_get_without_the_body(running):
    client = await running.ask("/", "HEAD")

    assert (await client.reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 200")
    assert running.app.method == "GET"
    await client.send(GET + b"\r\n")
    assert await client.status() == 200  # of the next one: there was nothing between
    assert client.body == b"here"


DEMO = Path(__file__).parents[4] / "deploy" / "demo.toml"


async def asked(host: str, came_to: str = "127.0.0.1") -> httpx2.Response:
    """Answer to a request to an address by a name, of a plant with names of its own."""
    read = tomllib.loads(DEMO.read_text(encoding="utf-8"))
    read.setdefault("service", {})["hosts"] = ["watch.plant.example"]
    read["delivery"] = {"dashboard_url": "https://people.plant.example:8443/"}
    plant = PlantFile.model_validate(read)
    app = server_of(PlainTextResponse("here"), plant, Origin.REPLAY).config.app
    transport = httpx2.ASGITransport(app)
    async with httpx2.AsyncClient(transport=transport, base_url=f"http://{came_to}/") as client:
        return await client.get("/", headers={"Host": host})


async def test_a_plant_s_service_answers_to_its_names_and_to_no_other():
    for host in (
        *("localhost", "127.0.0.1:8080", "[::1]", "LocalHost:1"),
        *("watch.plant.example", "Watch.Plant.Example.:443", "people.plant.example:8443"),
    ):
        assert (await asked(host)).status_code == 200, host
    for host in ("plant.example", "evil.example", "x.localhost", "[]", ":80"):
        assert (await asked(host)).status_code == 421, host
    for host in ("127.0.0.1:8231@evil", "127.0.0.1:abc", "localhost:123456", "[::1]evil"):
        assert (await asked(host)).status_code == 421, host


async def test_the_address_a_client_came_to_is_a_name_too():
    assert (await asked("10.0.0.7:8080", came_to="10.0.0.7")).status_code == 200
    assert (await asked("10.0.0.7")).status_code == 421


async def test_every_answer_names_origin_and_edition_even_a_refusal():
    for host in ("localhost", "evil.example"):
        headers = (await asked(host)).headers
        assert headers["padwatch-origin"] == "replay"
        assert headers["padwatch-edition"].startswith("0.")


MIB = 1024 * 1024


@pytest.mark.parametrize("is_chunked", [False, True])
async def test_two_hundred_mebibytes_cost_no_memory(running, is_chunked):
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
