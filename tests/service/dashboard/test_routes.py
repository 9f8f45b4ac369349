"""How the dashboard's files travel: complete, kept by browsers, under their edition."""

import asyncio
import gzip
import re
from collections import Counter
from collections.abc import Iterator

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from starlette.types import Message

from service.api.answers import EDITION_HEADER
from service.api.http.middleware import AddedHeaders, BoundedAnswers
from service.dashboard import assets as told
from service.dashboard.assets import Asset, edition, pages, plotly
from service.dashboard.routes import dashboard_router
from service.settings.processes import HttpLimitSettings

FILES = f"/static/{edition()}/"
AS_IS = {"Accept-Encoding": "identity"}


@pytest.fixture
def app() -> FastAPI:
    made = FastAPI()
    made.include_router(dashboard_router())
    return made


@pytest.fixture
def client(app: FastAPI) -> TestClient:
    return TestClient(app)


def test_no_inline_script_may_run_on_any_page(client) -> None:
    answer = client.get("/")
    policy = dict(
        directive.split(maxsplit=1)
        for directive in answer.headers["content-security-policy"].split("; ")
    )
    assert policy["default-src"] == "'self'"
    assert "script-src" not in policy
    assert "<script>" not in answer.text


def test_the_page_is_asked_for_each_time_and_its_files_once_for_each_edition(client) -> None:
    page = client.get("/", headers=AS_IS)
    assert page.headers["cache-control"] == "no-cache"
    named = re.findall(r'(?:href|src)="(/[^"]+)"', page.text)
    assert len(named) > 10
    for path in [*named, *(FILES + path for path in pages())]:
        answer = client.get(path, headers=AS_IS)
        assert answer.status_code == 200, path
        assert answer.content == pages()[path.removeprefix(FILES)].body, path
        assert answer.headers["cache-control"] == "public, max-age=31536000, immutable"


async def test_twenty_browsers_that_open_the_dashboard_at_once_all_get_every_file(
    app: FastAPI,
) -> None:
    some = list(pages())[::4]
    bounded = BoundedAnswers(app, HttpLimitSettings())
    found: Counter[int] = Counter()

    async def get(path: str) -> None:
        async def receive() -> Message:
            return {"type": "http.request", "body": b"", "more_body": False}

        async def send(message: Message) -> None:
            await asyncio.sleep(0)  # others get their turn meanwhile, as on a network
            if message["type"] == "http.response.start":
                found[message["status"]] += 1

        packed = (b"accept-encoding", b"gzip")
        scope = {"type": "http", "method": "GET", "path": path, "headers": [packed]}
        await bounded({**scope, "query_string": b"", "root_path": ""}, receive, send)

    async def connection(paths: Iterator[str]) -> None:
        for path in paths:
            await get(path)

    async def browser() -> None:
        await get("/")
        paths = iter([FILES + "plotly.min.js", *(FILES + path for path in some)])
        await asyncio.gather(*(connection(paths) for _ in range(6)))

    await asyncio.gather(*(browser() for _ in range(20)))

    assert found == {200: 20 * (2 + len(some))}


def test_a_page_of_another_edition_gets_no_file_of_this_one(client) -> None:
    for path in ("app.js", "plotly.min.js"):
        assert client.get(f"/static/0.0.1-12345678/{path}").status_code == 404


def test_the_chart_library_is_the_installed_one(client) -> None:
    answer = client.get(FILES + "plotly.min.js", headers=AS_IS)
    assert answer.content == plotly().body
    assert b"plotly.js v" in answer.content[:200]


@pytest.mark.parametrize("path", ["/", FILES + "app.js", FILES + "plotly.min.js"])
def test_a_browser_that_has_the_file_is_not_sent_it_again(client, path) -> None:
    etag = client.get(path).headers["etag"]
    again = client.get(path, headers={"If-None-Match": etag})
    assert again.status_code == 304
    assert again.content == b""
    changed = client.get(path, headers={"If-None-Match": '"of another version"'})
    assert changed.status_code == 200


def test_packed_and_plain_are_the_same_file_with_different_tags(client) -> None:
    plain = client.get(FILES + "app.js", headers=AS_IS)
    packed = client.get(FILES + "app.js", headers={"Accept-Encoding": "gzip"})
    assert packed.headers["content-encoding"] == "gzip"
    assert packed.content == plain.content == gzip.decompress(pages()["app.js"].gzipped)
    assert packed.headers["etag"] != plain.headers["etag"]


@pytest.mark.parametrize(
    "path",
    [
        *("nothing.js", "../routes.py", "%2e%2e/routes.py", "charts", ""),
        *("%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/passwd", "..%2f..%2f..%2f..%2fetc%2fpasswd"),
        *("%252e%252e%252fetc/passwd", "..\\..\\..\\etc\\passwd", "/etc/passwd", "%00"),
    ],
)
def test_nothing_else_is_served(client, path) -> None:
    answer = client.get(FILES + path)
    assert answer.status_code == 404
    assert "root:" not in answer.text


def test_every_answer_names_the_edition_even_a_refusal() -> None:
    app = FastAPI()
    app.add_middleware(AddedHeaders, headers=[(EDITION_HEADER, edition())])
    answer = TestClient(app).get("/api/v1/nothing-here")
    assert answer.status_code == 404
    assert answer.headers["padwatch-edition"] == edition()


def test_another_byte_in_any_file_of_the_dashboard_is_another_edition(monkeypatch) -> None:
    before = edition()
    changed = dict(told.pages())
    changed["app.js"] = Asset(changed["app.js"].body + b"\n", changed["app.js"].media_type)
    monkeypatch.setattr(told, "pages", lambda: changed)
    assert edition.__wrapped__() != before
