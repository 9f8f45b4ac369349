"""Every error is a problem document that names what is wrong; numbers and times of the API."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from datetime import UTC, datetime, timedelta, timezone
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.api.parameters import ns_from_datetime
from service.api.problems import ProblemError
from service.runtime.times import rfc3339
from service.store import trends

TRENDS = "/api/v1/units/U1/bearings/UJB/trends"
WHOLE = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-02T00:00:00Z"}
GOOD = {**WHOLE, "quantity": "speed_rpm"}


async def test_an_unknown_unit_bearing_or_path_is_not_found(read_only):
    bearing = "U9/bearings/UJB"
    units = ("U9", "U9/bearings", bearing, "u1", "%00", "'; DROP TABLE assessment; --")
    for path in (*units, *(f"{bearing}/{what}" for what in ("latest", "spectrum"))):
        problem = await read_only.problem(f"/api/v1/units/{path}", 404)
        assert problem["title"] == "Unknown unit"
        assert "unknown unit" in problem["detail"]
    for what in ("", "/latest", "/spectrum"):
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
async def test_a_wrong_query_is_answered_with_what_is_allowed(read_only, parameter, value, said):
    problem = await read_only.problem(TRENDS, 422, **{**GOOD, parameter: value})

    wrong = "start" if "before end" in said else parameter
    assert [error["parameter"].split(".")[0] for error in problem["errors"]] == [wrong]
    assert said in problem["errors"][0]["detail"]
    assert said in problem["detail"]


async def test_a_range_that_ends_before_its_beginning_is_refused(read_only):
    backwards = {"start": WHOLE["end"], "end": WHOLE["start"]}
    gaps = await read_only.problem("/api/v1/units/U1/gaps", 422, **backwards)
    assert gaps["errors"][0]["parameter"] == "start"
    for quantity in ("eccentricity", "oil_temperature"):
        bounds = {f"{quantity}_min": 2.5, f"{quantity}_max": 1.5}

        problem = await read_only.problem(TRENDS, 422, **GOOD, **bounds)

        assert problem["errors"][0]["parameter"] == f"{quantity}_min"
        assert problem["detail"] == (
            f"{quantity}_min must be at most 1.5, the requested maximum, got 2.5"
        )


async def test_missing_and_all_wrong_parameters_are_named(read_only):
    for parameter in GOOD.keys() - {"end"}:  # without an end, the period ends now
        query = {name: value for name, value in GOOD.items() if name != parameter}

        problem = await read_only.problem(TRENDS, 422, **query)

        assert [error["parameter"] for error in problem["errors"]] == [parameter]
        assert "required" in problem["detail"].lower()
    wrong = {"start": "soon", "end": "later", "max_points": 0}
    problem = await read_only.problem(TRENDS, 422, **{**GOOD, **wrong})
    assert {error["parameter"] for error in problem["errors"]} == set(wrong)


async def test_a_parameter_that_nobody_knows_is_refused_everywhere(read_only):
    for path in ("livez", "readyz", "api/v1/sources", "api/v1/units/U1", "api/v1/quantities"):
        problem = await read_only.problem(f"/{path}", 422, verbose=1)

        assert problem["errors"][0]["parameter"] == "verbose"
        assert problem["detail"] == "unknown parameter 'verbose'; known parameters: none"


async def test_a_problem_document_has_at_most_2_kb_whatever_was_asked(read_only):
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


async def test_a_range_that_could_take_all_memory_is_refused(read_only, monkeypatch):
    monkeypatch.setattr(trends, "MAX_ROWS", 3)

    problem = await read_only.problem(TRENDS, 422, **GOOD)

    assert {error["parameter"] for error in problem["errors"]} == {"start", "end"}
    assert problem["detail"].startswith("more than 3 single readings would have to be read")


async def test_a_store_that_cannot_be_read_is_503_without_its_innards(running):
    with closing(sqlite3.connect(running.store.database._path)) as connection:
        connection.executescript("DROP TABLE gap; ALTER TABLE assessment RENAME TO gone")

    for path, query in ((TRENDS, GOOD), ("/api/v1/units/U1/gaps", WHOLE)):
        problem = await running.problem(path, 503, **query)
        assert problem["detail"] == (
            "the store cannot be read now; try again, or see the log of the service"
        )


async def test_far_years_are_no_error(read_only):
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


async def test_a_method_a_path_does_not_have_is_refused_with_those_it_has(read_only, as_problem):
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


async def test_a_parameter_that_is_no_number_is_named(read_only):
    asked = list(questions(read_only.document))
    assert len(asked) > 20
    for path, others, name in asked:
        for written in NONE:
            problem = await read_only.problem(path, 422, **{**others, name: written})
            assert name in {mistake["parameter"].split(".")[0] for mistake in problem["errors"]}


async def test_a_body_with_a_number_that_is_none_or_without_a_shape_is_refused(read_only):
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


OFFSETS = st.integers(-14 * 60, 14 * 60).map(lambda m: timezone(timedelta(minutes=m)))


@given(st.datetimes(timezones=st.just(UTC)))
def test_a_time_survives_the_way_out_and_in_to_the_millisecond(moment):
    time_ns = ns_from_datetime(moment, "start")

    back = datetime.fromisoformat(rfc3339(time_ns))

    assert timedelta(0) <= moment - back < timedelta(milliseconds=1)
    assert ns_from_datetime(back, "start") == time_ns - time_ns % 1_000_000


@given(st.datetimes(datetime(2, 1, 1), datetime(9998, 1, 1)), OFFSETS)
def test_the_same_instant_is_the_same_number_in_every_zone(local, zone):
    moment = local.replace(tzinfo=zone)

    assert ns_from_datetime(moment, "end") == ns_from_datetime(moment.astimezone(UTC), "end")


@pytest.mark.parametrize(
    ("time_ns", "written"),
    [
        (0, "1970-01-01T00:00:00.000Z"),
        (1_767_225_600_000_000_000, "2026-01-01T00:00:00.000Z"),
        (1_767_225_600_999_999_999, "2026-01-01T00:00:00.999Z"),
        (2**63 - 1, "2262-04-11T23:47:16.854Z"),
        (-1, "1969-12-31T23:59:59.999Z"),
        (253_402_300_799_000_000_000, "9999-12-31T23:59:59.000Z"),
        (-62_135_596_800_000_000_000, "0001-01-01T00:00:00.000Z"),
    ],
)
def test_known_times_are_written_as_expected(time_ns, written):
    assert rfc3339(time_ns) == written


def test_a_time_without_offset_is_refused_rather_than_guessed():
    with pytest.raises(ProblemError, match="end requires an offset from UTC"):
        ns_from_datetime(datetime(2026, 1, 1), "end")
