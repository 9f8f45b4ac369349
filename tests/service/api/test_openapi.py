"""The published description of the API is complete."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import httpx2
import pytest
from jsonschema_rs import Draft202012Validator
from pydantic import BaseModel

from service.api.answers import Answers
from service.api.app import GuardedApi
from service.app.serving_process import application, server_of
from service.settings.storage import Origin

Operations = list[tuple[str, dict[str, Any]]]


@pytest.fixture
def operations(read_only: Any) -> Operations:
    return [
        (f"{method.upper()} {path}", operation)
        for path, methods in read_only.document["paths"].items()
        for method, operation in methods.items()
    ]


async def test_the_description_is_served_and_every_reference_of_it_leads_somewhere(read_only):
    assert await read_only.json("/api/v1/openapi.json") == read_only.document
    json.dumps(read_only.document, allow_nan=False)  # no example holds a number that is none
    references = re.findall(r"'\$ref': '([^']+)'", str(read_only.document))
    assert references
    for reference in references:
        assert _resolved(reference, read_only.document)


async def test_the_description_is_rendered_once_and_for_no_other_request(read_only, monkeypatch):
    document, made = read_only.document, []
    monkeypatch.setattr(GuardedApi, "openapi", lambda _: made.append(1) or document)
    transport = httpx2.ASGITransport(
        application(replace(read_only.context, answers=Answers()), read_only.desk)
    )
    async with httpx2.AsyncClient(transport=transport, base_url="http://padwatch") as client:
        for method, path, status in (
            ("GET", "/api/v1/units", 200),
            ("GET", "/api/v1/units?verbose=1", 422),
            ("DELETE", "/api/v1/units", 405),
        ):
            assert (await client.request(method, path)).status_code == status
        assert made == []
        for _ in range(2):
            assert (await client.get("/api/v1/openapi.json")).json() == document
    assert made == [1]


def test_every_operation_is_explained_and_has_an_example(read_only, operations):
    assert len(operations) >= 62
    for name, operation in operations:
        assert operation["summary"], name
        assert len(operation["description"]) > 20, name
        nodes = list(_reachable(operation, read_only.document))
        assert any("example" in node or node.get("examples") for node in nodes), name
        for parameter in operation.get("parameters", ()):
            assert parameter["description"], f"{name}: {parameter['name']}"
            assert {"example", "examples", "default"} & {*parameter, *parameter["schema"]}, name


def test_every_error_is_documented_as_a_problem(operations):
    by_end_of_path = {
        "404": {"configuration", "recordings", "rates"},
        "409": {"waveform", "readings", "spectrum"},
        "410": {"{recording}"},
        "503": {
            *("gaps", "trends", "references", "readings", "baselines"),
            *("events", "rates", "{recording}"),
        },
    }
    for name, operation in operations:
        method, path = name.split()
        end = path.rpartition("/")[2]
        expected = {"default", "422"} | {n for n, ends in by_end_of_path.items() if end in ends}
        if "{" in path:
            expected |= {"404"} if method == "GET" else {"403", "404", "503"}
            if method != "GET" and end != "notes":  # a note contradicts nothing
                expected |= {"409"}
        responses = operation["responses"]
        assert set(responses) >= expected, name
        for status, response in responses.items():
            if status[0] in "23" or (name, status) == ("GET /readyz", "503"):
                continue
            [(media_type, content)] = response["content"].items()
            assert media_type == "application/problem+json", f"{name} {status}"
            assert content["schema"] == {"$ref": "#/components/schemas/Problem"}


async def test_a_problem_is_as_it_is_described(read_only):
    problem = await read_only.problem("/api/v1/units/U1/gaps", 422, start="x", end="2026-01-01Z")

    schema = {
        "$ref": "#/components/schemas/Problem",
        "components": read_only.document["components"],
    }
    Draft202012Validator(schema).validate(problem)
    assert {mistake["parameter"] for mistake in problem["errors"]} >= {"start"}


def test_every_model_refuses_what_it_does_not_know_and_numbers_that_are_none(read_only):
    models: dict[str, list[type[BaseModel]]] = {}
    for model in _models(BaseModel):
        models.setdefault(model.__name__, []).append(model)
    for name, schema in read_only.document["components"]["schemas"].items():
        if schema.get("type") == "object":
            assert schema.get("additionalProperties") is False, name
            for model in models.get(name, ()):  # a dataclass is no model
                assert model.model_config.get("extra") == "forbid", model
                assert model.model_config.get("allow_inf_nan") is False, model


def test_operations_are_named_by_their_address(operations):
    names = {name: operation["operationId"] for name, operation in operations}

    assert len(set(names.values())) == len(names)
    assert names["GET /api/v1/overview"] == "get_overview"
    latest = "GET /api/v1/units/{unit}/bearings/{bearing}/latest"
    assert names[latest] == "get_units_unit_bearings_bearing_latest"
    shelve = "POST /api/v1/alarms/{alarm}/shelve"
    assert names[shelve] == "post_alarms_alarm_shelve"


def test_every_answer_that_can_be_asked_for_again_says_how(operations):
    for name, operation in operations:
        is_json = "application/json" in operation["responses"].get("200", {}).get("content", {})
        is_tagged = name.startswith("GET /api/") and is_json
        asked = [p["name"] for p in operation.get("parameters", ()) if p["in"] == "header"]
        assert asked == (["If-None-Match"] if is_tagged else []), name
        assert ("304" in operation["responses"]) == is_tagged, name
        if is_tagged:
            for status in ("200", "304"):
                assert "ETag" in operation["responses"][status]["headers"], name


async def test_the_headers_that_are_described_are_there(read_only, plant):
    server = server_of(read_only.app, plant, Origin.LIVE)
    transport = httpx2.ASGITransport(server.config.app)
    await read_only.client.get("/livez")  # takes the report of measuring
    client = httpx2.AsyncClient(transport=transport, base_url="http://localhost")
    for path in ("overview", "sources", "alarms", "audit", "units/U1/bearings/UJB/spectrum"):
        described = read_only.document["paths"][
            f"/api/v1/{path.replace('U1', '{unit}').replace('UJB', '{bearing}')}"
        ]["get"]["responses"]
        full = await client.get(f"/api/v1/{path}")
        again = await client.get(f"/api/v1/{path}", headers={"If-None-Match": full.headers["etag"]})
        for answer in (full, again):
            names = set(described[str(answer.status_code)]["headers"]) - {"Padwatch-Next-Cursor"}
            assert {name.lower() for name in names} <= set(answer.headers), path


def test_every_field_of_every_answer_is_explained(read_only):
    for name, schema in read_only.document["components"]["schemas"].items():
        assert schema.get("description"), name
        for key, field in schema.get("properties", {}).items():
            # one that says the same as the model it refers to is left to that
            assert field.get("description") or "$ref" in field, f"{name}.{key}"


def _models(base: type[BaseModel]) -> Iterator[type[BaseModel]]:
    for model in base.__subclasses__():
        if model.__module__.startswith(("service.api.", "service.reports.")):
            yield model
        yield from _models(model)


def _resolved(reference: str, document: dict[str, Any]) -> dict[str, Any]:
    node: Any = document
    assert reference.startswith("#/")
    for part in reference[2:].split("/"):
        node = node[part]
    found: dict[str, Any] = node
    return found


def _reachable(node: Any, document: dict[str, Any]) -> Iterator[dict[str, Any]]:
    if isinstance(node, dict):
        yield node
        if "$ref" in node:
            yield from _reachable(_resolved(node["$ref"], document), document)
        for value in node.values():
            yield from _reachable(value, document)
    elif isinstance(node, list):
        for value in node:
            yield from _reachable(value, document)
