"""No number that is none comes in, wherever a number is asked for."""

from collections.abc import Iterator
from typing import Any

NONE = ("nan", "inf", "-inf", "Infinity", "1e999")

PLACES = {
    "unit": "U1",
    "bearing": "UJB",
    "quantity": "speed_rpm",
    "version": "1",
    "alarm": "U1:ujb_shaft_x:channel_not_ok",
    "occurrence": "1",
    "recording": "U1-20261121T090312.400Z-shaft_x",
}

RANGE = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-02T00:00:00Z"}


def kinds(schema: dict[str, Any]) -> set[str]:
    """Types that a schema allows."""
    return {choice.get("type", "") for choice in schema.get("anyOf", [schema])}


def questions(document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], str]]:
    """Every parameter that is a number, with an address and whatever else must be given."""
    for path, methods in document["paths"].items():
        for parameter in methods.get("get", {}).get("parameters", ()):
            if parameter["in"] == "query" and kinds(parameter["schema"]) & {"number", "integer"}:
                names = {p["name"] for p in methods["get"]["parameters"]}
                others = {name: RANGE[name] for name in RANGE if name in names}
                if "channel" in names:
                    others["channel"] = "shaft_x"
                if "quantity" in names:
                    others["quantity"] = "speed_rpm"
                yield path.format(**PLACES), others, parameter["name"]


async def test_a_parameter_that_is_no_number_is_named(read_only: Any) -> None:
    asked = list(questions(read_only.document))
    assert len(asked) > 20
    for path, others, name in asked:
        for written in NONE:
            problem = await read_only.problem(path, 422, **{**others, name: written})
            assert name in {mistake["parameter"].split(".")[0] for mistake in problem["errors"]}


async def test_a_body_with_a_number_that_is_none_or_without_a_shape_is_refused(
    read_only: Any,
) -> None:
    path = "/api/v1/alarms/U1:ujb_shaft_x:channel_not_ok/shelve"
    whole = '{"actor": "A. Name", "reason": "test", "duration_s": %s}'
    numbers = ("NaN", "Infinity", "-Infinity", "1e999", '"nan"')
    reasons = (r'"a\ud800"', r'"a\u0000b"')
    for body in (
        *("", "null", whole[:-1] % 60.0),
        *(whole % written for written in numbers),
        *(whole.replace('"test"', reason) % 60.0 for reason in reasons),
    ):
        headers = {"content-type": "application/json"}
        answer = await read_only.client.post(path, content=body, headers=headers)
        assert answer.status_code == 422, body
