"""The published description of the API is complete."""

import re
from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture
def operations(service: Any) -> list[tuple[str, dict[str, Any]]]:
    return [
        (f"{method.upper()} {path}", operation)
        for path, methods in service.document["paths"].items()
        for method, operation in methods.items()
    ]


async def test_the_description_is_served(service: Any) -> None:
    assert await service.json("/api/v1/openapi.json") == service.document


def test_every_operation_is_explained(operations: list[tuple[str, dict[str, Any]]]) -> None:
    assert len(operations) == 62
    for name, operation in operations:
        assert operation["summary"], name
        assert len(operation["description"]) > 20, name
        for parameter in operation.get("parameters", ()):
            assert parameter["description"], f"{name}: {parameter['name']}"


def test_every_operation_has_an_example(
    service: Any, operations: list[tuple[str, dict[str, Any]]]
) -> None:
    for name, operation in operations:
        nodes = list(_reachable(operation, service.document))
        assert any("example" in node or node.get("examples") for node in nodes), name
        for parameter in operation.get("parameters", ()):
            assert {"example", "examples", "default"} & {*parameter, *parameter["schema"]}, name


def test_every_error_is_documented_as_a_problem(
    operations: list[tuple[str, dict[str, Any]]],
) -> None:
    expected = {
        "GET /api/v1/units/{unit}": {"404"},
        "GET /api/v1/units/{unit}/channels": {"404"},
        "GET /api/v1/units/{unit}/waveform": {"404", "409", "422"},
        "GET /api/v1/units/{unit}/gaps": {"404", "422", "503"},
        "GET /api/v1/units/{unit}/bearings": {"404"},
        "GET /api/v1/units/{unit}/bearings/{bearing}": {"404"},
        "GET /api/v1/units/{unit}/bearings/{bearing}/latest": {"404"},
        "GET /api/v1/units/{unit}/bearings/{bearing}/trends": {"404", "422", "503"},
        "GET /api/v1/units/{unit}/bearings/{bearing}/shaft-centre": {"404", "422", "503"},
        "GET /api/v1/configuration": {"404"},
        "GET /api/v1/recordings": {"404", "422"},
        "GET /api/v1/recordings/{recording}": {"404", "422", "500", "503"},
        "GET /api/v1/units/{unit}/bearings/{bearing}/references": {"404", "503"},
        "GET /api/v1/units/{unit}/bearings/{bearing}/film/readings": {"404", "409", "422", "503"},
        "GET /api/v1/units/{unit}/bearings/{bearing}/baselines": {"404", "503"},
        "POST /api/v1/units/{unit}/bearings/{bearing}/baselines/renew": {
            *("403", "404", "409", "422", "503"),
        },
        "GET /api/v1/alarms/events": {"422", "503"},
        "GET /api/v1/alarms/rates": {"404", "422", "503"},
        "GET /api/v1/alarms/{alarm}": {"404"},
        "POST /api/v1/alarms/{alarm}/comment": {"403", "404", "409", "422", "503"},
        "POST /api/v1/units/{unit}/bearings/{bearing}/order1-references": {
            *("403", "404", "409", "422", "503"),
        },
        "POST /api/v1/alarms/{alarm}/acknowledge": {"403", "404", "409", "422", "503"},
        "POST /api/v1/alarms/{alarm}/shelve": {"403", "404", "409", "422", "503"},
        "GET /api/v1/units/{unit}/bearings/{bearing}/spectrum": {"404", "409"},
        "GET /api/v1/units/{unit}/bearings/{bearing}/orbit": {"404", "409"},
    }
    for name, operation in operations:
        responses = operation["responses"]
        assert set(responses) >= {"default", *expected.get(name, ())}, name
        for status, response in responses.items():
            if status.startswith("2") or (name, status) == ("GET /readyz", "503"):
                continue
            [(media_type, content)] = response["content"].items()
            assert media_type == "application/problem+json", f"{name} {status}"
            assert "instance" in content["schema"]["properties"]


def test_every_field_of_every_answer_is_explained(service: Any) -> None:
    for name, schema in service.document["components"]["schemas"].items():
        assert schema.get("description"), name
        for key, field in schema.get("properties", {}).items():
            # one that says the same as the model it refers to is left to that
            assert field.get("description") or "$ref" in field, f"{name}.{key}"


def test_every_reference_leads_somewhere(service: Any) -> None:
    references = re.findall(r"'\$ref': '([^']+)'", str(service.document))

    assert references
    for reference in references:
        assert _resolved(reference, service.document)


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
