"""How the dashboard's files travel: complete, compressed, kept by browsers, under a hash."""

import gzip
import json
import posixpath
import re

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from service.dashboard import assets as told
from service.dashboard.assets import (
    Asset,
    StaticFiles,
    compress_all,
    edition,
    libraries,
    pages,
    served,
)
from service.dashboard.bundle import IMPORT

FILES = f"/static/{edition()}/"
PLOTLY, _ = libraries()["plotly.min.js"]
AS_IS = {"Accept-Encoding": "identity"}


@pytest.fixture
def client() -> TestClient:
    app = FastAPI()
    app.add_middleware(StaticFiles)
    return TestClient(app)


@pytest.mark.parametrize("page", ["/", "/docs"])
def test_no_inline_script_may_run_on_any_page(client, page):
    answer = client.get(page)
    policy = dict(
        directive.split(maxsplit=1)
        for directive in answer.headers["content-security-policy"].split("; ")
    )
    assert policy["default-src"] == "'self'"
    assert "script-src" not in policy
    assert "<script>" not in answer.text


@pytest.mark.parametrize("page", ["/", "/docs"])
def test_a_page_is_asked_for_each_time_and_its_files_once_for_each_hash(client, page):
    answer = client.get(page, headers=AS_IS)
    assert answer.headers["cache-control"] == "no-cache"
    named = re.findall(r'(?:href|src)="(/[^"]+)"', answer.text)
    assert len(named) > 3
    for path in named:
        file = client.get(path, headers=AS_IS)
        assert file.status_code == 200, path
        assert file.content == served()[path].body, path
        assert file.headers["cache-control"] == "public, max-age=31536000, immutable"


def test_the_page_loads_one_script_of_all_modules_and_one_style_sheet(client):
    page = client.get("/").text
    named = re.findall(r'(?:href|src)="/static/[^/]+/([^"]+)"', page)
    assert named == ["padwatch.svg", "all.css", "recover.js", "all.js"]
    script, modules = (found := pages())["all.js"].body.decode(), set()
    for path in re.findall("^// (.+[.]js)$", script, re.MULTILINE):
        text = found[path].body.decode()
        used = {posixpath.join(posixpath.dirname(path), link) for _, link in IMPORT.findall(text)}
        assert {posixpath.normpath(link) for link in used} <= modules, path
        modules.add(path)
    assert modules == {path for path in found if path.endswith(".js")} - {"docs.js", "all.js"}
    sheets = [found[path].body for path in found if path.endswith(".css") and path != "all.css"]
    assert len(found["all.css"].body) == sum(map(len, sheets))


def test_a_page_of_another_edition_gets_no_file_of_this_one(client):
    for path in ("0.0.1-12345678/app.js", "0123456789ab/plotly.min.js"):
        answer = client.get(f"/static/{path}")
        assert answer.status_code == 404
        assert answer.headers["content-type"] == "application/problem+json"
        assert "reload the page" in answer.json()["detail"]


def test_the_libraries_are_the_installed_ones_and_named_by_their_content(client):
    answer = client.get(PLOTLY, headers=AS_IS)
    assert b"plotly.js v" in answer.content[:200]
    assert PLOTLY.split("/")[2] == libraries()["plotly.min.js"][1].digest[:12]
    named = json.loads(pages()["libraries.js"].body.partition(b" = ")[2].rstrip(b";\n"))
    assert named["plotly.min.js"] == PLOTLY


@pytest.mark.parametrize("path", ["/", "/docs", FILES + "app.js", PLOTLY])
def test_a_browser_that_has_the_file_is_not_sent_it_again(client, path):
    etag = client.get(path).headers["etag"]
    again = client.get(path, headers={"If-None-Match": etag})
    assert again.status_code == 304
    assert again.content == b""
    changed = client.get(path, headers={"If-None-Match": '"of another version"'})
    assert changed.status_code == 200


def test_packed_and_plain_are_the_same_file_with_different_tags(client):
    compress_all()
    for path, asset in served().items():
        assert asset.gzipped is not None, path
        assert gzip.decompress(asset.gzipped) == asset.body, path
    plain = client.get(FILES + "app.js", headers=AS_IS)
    packed = client.get(FILES + "app.js", headers={"Accept-Encoding": "gzip"})
    assert "content-encoding" not in plain.headers
    assert packed.headers["content-encoding"] == "gzip"
    assert packed.content == plain.content == pages()["app.js"].body
    assert packed.headers["etag"] != plain.headers["etag"]


def test_a_file_that_is_not_compressed_yet_is_sent_as_it_is(client, monkeypatch):
    monkeypatch.setattr(served()[FILES + "app.js"], "gzipped", None)
    answer = client.get(FILES + "app.js", headers={"Accept-Encoding": "gzip"})
    assert "content-encoding" not in answer.headers
    assert answer.content == pages()["app.js"].body


@pytest.mark.parametrize(
    "path",
    [
        *("nothing.js", "../assets.py", "%2e%2e/assets.py", "charts", ""),
        *("%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/passwd", "..%2f..%2f..%2f..%2fetc%2fpasswd"),
        *("%252e%252e%252fetc/passwd", "..\\..\\..\\etc\\passwd", "/etc/passwd", "%00"),
    ],
)
def test_nothing_else_is_served(client, path):
    answer = client.get(FILES + path)
    assert answer.status_code == 404
    assert "root:" not in answer.text


def test_another_byte_in_any_file_of_the_dashboard_is_another_edition(monkeypatch):
    before = edition()
    changed = dict(told.pages())
    changed["app.js"] = Asset(changed["app.js"].body + b"\n", changed["app.js"].media_type)
    monkeypatch.setattr(told, "pages", lambda: changed)
    assert edition.__wrapped__() != before
