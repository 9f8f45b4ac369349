"""An open page learns from any answer that the service has become another one."""

from fastapi import FastAPI
from fastapi.testclient import TestClient

from service.dashboard import edition as told
from service.dashboard.assets import Asset
from service.dashboard.edition import EditionHeader, edition


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
