"""How the dashboard's files travel: complete, uncached where they change, under their edition."""

import gzip

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from service.dashboard import edition as told
from service.dashboard.assets import Asset, pages, plotly
from service.dashboard.edition import EditionHeader, edition
from service.dashboard.routes import dashboard_router

AS_IS = {"Accept-Encoding": "identity"}


@pytest.fixture
def client() -> TestClient:
    app = FastAPI()
    app.include_router(dashboard_router())
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


def test_every_file_that_a_page_names_is_there(client) -> None:
    for path, asset in pages().items():
        answer = client.get(f"/static/{path}", headers=AS_IS)
        assert answer.content == asset.body, path
        assert answer.headers["cache-control"] == "no-cache"


def test_the_chart_library_is_the_installed_one_and_may_be_kept(client) -> None:
    answer = client.get("/static/plotly.min.js", headers=AS_IS)
    assert answer.content == plotly().body
    assert b"plotly.js v" in answer.content[:200]
    assert "max-age=604800" in answer.headers["cache-control"]


@pytest.mark.parametrize("path", ["/", "/static/app.js", "/static/plotly.min.js"])
def test_a_browser_that_has_the_file_is_not_sent_it_again(client, path) -> None:
    etag = client.get(path).headers["etag"]
    again = client.get(path, headers={"If-None-Match": etag})
    assert again.status_code == 304
    assert again.content == b""
    changed = client.get(path, headers={"If-None-Match": '"of another version"'})
    assert changed.status_code == 200


def test_packed_and_plain_are_the_same_file_with_different_tags(client) -> None:
    plain = client.get("/static/app.js", headers=AS_IS)
    packed = client.get("/static/app.js", headers={"Accept-Encoding": "gzip"})
    assert packed.headers["content-encoding"] == "gzip"
    assert packed.content == plain.content == gzip.decompress(pages()["app.js"].gzipped)
    assert packed.headers["etag"] != plain.headers["etag"]


@pytest.mark.parametrize("path", ["nothing.js", "../routes.py", "%2e%2e/routes.py", "charts", ""])
def test_nothing_else_is_served(client, path) -> None:
    assert client.get(f"/static/{path}").status_code == 404


def test_every_answer_names_the_edition_even_a_refusal() -> None:
    app = FastAPI()
    app.add_middleware(EditionHeader)
    answer = TestClient(app).get("/api/v1/nothing-here")
    assert answer.status_code == 404
    assert answer.headers["padwatch-edition"] == edition()


def test_another_byte_in_any_file_of_the_dashboard_is_another_edition(monkeypatch) -> None:
    before = edition()
    changed = dict(told.pages())
    changed["app.js"] = Asset(changed["app.js"].body + b"\n", changed["app.js"].media_type)
    monkeypatch.setattr(told, "pages", lambda: changed)
    assert edition.__wrapped__() != before
