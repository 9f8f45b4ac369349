"""Every error is a problem document that names what is wrong."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from typing import Any

import httpx2
import pytest

from service.store import trends

AsProblem = Callable[[httpx2.Response], dict[str, Any]]

TRENDS = "/api/v1/units/U1/bearings/UJB/trends"
WHOLE = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-02T00:00:00Z"}
GOOD = {**WHOLE, "quantity": "speed_rpm"}


async def test_an_unknown_unit_bearing_or_path_is_not_found(read_only: Any) -> None:
    bearing = "U9/bearings/UJB"
    units = ("U9", "U9/bearings", bearing, "u1", "%00", "'; DROP TABLE assessment; --")
    for path in (*units, *(f"{bearing}/{what}" for what in ("latest", "spectrum", "orbit"))):
        problem = await read_only.problem(f"/api/v1/units/{path}", 404)
        assert problem["title"] == "Unknown unit"
        assert "there is no unit" in problem["detail"]
    for what in ("", "/latest", "/spectrum", "/orbit"):
        problem = await read_only.problem(f"/api/v1/units/U1/bearings/XJB{what}", 404)
        assert problem["detail"] == "unit 'U1' has no bearing 'XJB'"
    await read_only.problem("/api/v1/units/U9/bearings/UJB/trends", 404, **GOOD)
    await read_only.problem("/api/v1/units/U1/bearings/XJB/trends", 404, **GOOD)
    await read_only.problem("/api/v1/units/U9/gaps", 404, **WHOLE)
    for path in ("/api/v1/nothing", "/api/v2/units", "/nowhere", "/static/no.js"):
        await read_only.problem(path, 404)


@pytest.mark.parametrize(
    ("parameter", "value", "said"),
    [
        ("max_points", 1, "greater than or equal to 2"),
        ("max_points", 1_000_000_000, "less than or equal to 5000"),
        ("max_points", "9" * 5000, ""),
        ("max_points", "many", "valid integer"),
        ("max_points", "2.5", "valid integer"),
        ("start", "2026-01-03T00:00:00Z", "must be before end"),
        ("start", "2026-01-02T00:00:00Z", "must be before end"),
        ("start", "2026-01-01T00:00:00", "offset from UTC"),
        ("start", "yesterday", "must be RFC 3339, such as 2026-11-21T08:00:00Z"),
        ("start", "1767225600", "must be RFC 3339, such as 2026-11-21T08:00:00Z"),
        ("start", "1e-5", ""),
        ("start", "2026-02-30T00:00:00Z", "day value is outside expected range"),
        ("start", "2026-01-01T25:00:00Z", "valid datetime"),
        ("start", "+10000-01-01T00:00:00Z", ""),
        ("end", "2025-01-01T00:00:00Z", "must be before end"),
        ("end", "", "must be RFC 3339"),
        ("eccentricity_min", "nan", "finite number"),
        ("oil_temperature_max", "warm", "valid number"),
        ("quantity", "stiffness", "not in the catalogue"),
        ("state", "overload", "'full_load'"),
        ("group_by", "weekday", ""),
        ("quantity", ["speed_rpm", "speed"], "not in the catalogue"),
        ("quantity", ["speed_rpm"] * 41, "at most 40"),
        ("max_point", 10, "unknown parameter 'max_point'; known parameters: quantity, state"),
    ],
)
async def test_a_wrong_query_is_answered_with_the_parameter_and_what_is_allowed(
    read_only: Any, parameter: str, value: object, said: str
) -> None:
    problem = await read_only.problem(TRENDS, 422, **{**GOOD, parameter: value})

    wrong = "start" if "before end" in said else parameter
    assert [error["parameter"].split(".")[0] for error in problem["errors"]] == [wrong]
    assert said in problem["errors"][0]["detail"]
    assert said in problem["detail"]


async def test_a_range_that_ends_before_its_beginning_is_refused(read_only: Any) -> None:
    backwards = {"start": WHOLE["end"], "end": WHOLE["start"]}
    gaps = await read_only.problem("/api/v1/units/U1/gaps", 422, **backwards)
    assert gaps["errors"][0]["parameter"] == "start"
    for quantity in ("eccentricity", "oil_temperature"):
        bounds = {f"{quantity}_min": 2.5, f"{quantity}_max": 1.5}

        problem = await read_only.problem(TRENDS, 422, **GOOD, **bounds)

        assert problem["errors"][0]["parameter"] == f"{quantity}_min"
        assert problem["detail"] == f"{quantity}_min 2.5 must not be above its maximum 1.5"


async def test_missing_and_all_wrong_parameters_are_named(read_only: Any) -> None:
    for parameter in GOOD:
        query = {name: value for name, value in GOOD.items() if name != parameter}

        problem = await read_only.problem(TRENDS, 422, **query)

        assert [error["parameter"] for error in problem["errors"]] == [parameter]
        assert "required" in problem["detail"].lower()
    wrong = {"start": "soon", "end": "later", "max_points": 0}
    problem = await read_only.problem(TRENDS, 422, **{**GOOD, **wrong})
    assert {error["parameter"] for error in problem["errors"]} == set(wrong)


async def test_a_parameter_that_nobody_knows_is_refused_everywhere(read_only: Any) -> None:
    for path in ("livez", "readyz", "api/v1/overview", "api/v1/units/U1", "api/v1/quantities"):
        problem = await read_only.problem(f"/{path}", 422, verbose=1)

        assert problem["errors"][0]["parameter"] == "verbose"
        assert problem["detail"] == "unknown parameter 'verbose'; known parameters: none"


async def test_a_problem_document_has_at_most_2_kb_whatever_was_asked(read_only: Any) -> None:
    unknown = {f"member_{number}": number for number in range(8000)}
    for asked, status in (
        (read_only.client.post("/api/v1/session", json=unknown), 422),
        (read_only.client.post("/api/v1/session", json={"name": "\x01" * 9999}), 422),
        (read_only.get("/api/v1/units/" + "%01" * 2600), 404),
        (read_only.get(TRENDS, **GOOD, **{"ж" * 1300: 1}), 422),
        (read_only.get(TRENDS, **{**GOOD, "state": ["overload"] * 500}), 422),
    ):
        answer = await asked
        assert answer.status_code == status
        assert len(answer.content) <= 2048
        assert answer.json()["detail"]


async def test_a_range_that_could_take_all_memory_is_refused(
    read_only: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trends, "MAX_ROWS", 3)

    problem = await read_only.problem(TRENDS, 422, **GOOD)

    assert {error["parameter"] for error in problem["errors"]} == {"start", "end"}
    assert problem["detail"].startswith("more than 3 single readings would have to be read")


async def test_a_store_that_cannot_be_read_is_503_without_its_innards(running: Any) -> None:
    with closing(sqlite3.connect(running.store._path)) as connection:
        connection.executescript("DROP TABLE gap; ALTER TABLE assessment RENAME TO gone")

    for path, query in ((TRENDS, GOOD), ("/api/v1/units/U1/gaps", WHOLE)):
        problem = await running.problem(path, 503, **query)
        assert problem["detail"] == "the store cannot be read now"


async def test_far_years_are_no_error(read_only: Any) -> None:
    for start, end in (
        ("0001-01-01T00:00:00Z", "9999-12-31T23:59:59.999999Z"),
        ("0001-01-01T00:00:00+14:00", "9999-12-31T23:59:59-14:00"),
        ("1969-12-31T23:59:59Z", "2300-01-01T00:00:00Z"),
    ):
        times = {"start": start, "end": end}
        for max_points in (2, 5000):
            query = {**times, "quantity": "speed_rpm", "max_points": max_points}
            body = await read_only.json(TRENDS, **query)
            assert sum(body["series"]["speed_rpm"]["count"]) == 6
            assert len(body["time"]) <= max_points
        assert await read_only.json("/api/v1/units/U1/gaps", **times) == []


async def test_a_method_a_path_does_not_have_is_refused_with_those_it_has(
    read_only: Any, as_problem: AsProblem
) -> None:
    for method, path, allowed in (
        ("GET", "/api/v1/units/U1/bearings/UJB/baselines/freeze", "POST"),
        ("POST", "/api/v1/units/U1/bearings/UJB/baselines/3", "GET"),
        ("GET", "/api/v1/units/U1/bearings/UJB/baselines/freeze/accept", "POST"),
        ("DELETE", "/api/v1/units/U1/bearings/UJB/order1-references", "GET, POST"),
        *((method, "/api/v1/units", "GET") for method in ("POST", "PUT", "PATCH", "DELETE")),
    ):
        response = await read_only.client.request(method, path)

        assert response.status_code == 405
        assert response.headers["allow"] == allowed
        assert as_problem(response)["title"] == "Method not allowed"
