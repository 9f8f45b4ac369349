"""Numbers and times at the API: no number that is none, RFC 3339 outside, nanoseconds inside."""

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta, timezone
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.api.parameters import ns_from_datetime
from service.api.problems import ProblemError
from service.runtime.times import rfc3339

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


OFFSETS = st.integers(-14 * 60, 14 * 60).map(lambda m: timezone(timedelta(minutes=m)))


@given(st.datetimes(timezones=st.just(UTC)))
def test_a_time_survives_the_way_out_and_in_to_the_millisecond(moment: datetime) -> None:
    time_ns = ns_from_datetime(moment, "start")

    back = datetime.fromisoformat(rfc3339(time_ns))

    assert timedelta(0) <= moment - back < timedelta(milliseconds=1)
    assert ns_from_datetime(back, "start") == time_ns - time_ns % 1_000_000


@given(st.datetimes(datetime(2, 1, 1), datetime(9998, 1, 1)), OFFSETS)
def test_the_same_instant_is_the_same_number_in_every_zone(local: datetime, zone: timezone) -> None:
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
def test_known_times_are_written_as_expected(time_ns: int, written: str) -> None:
    assert rfc3339(time_ns) == written


def test_a_time_without_offset_is_refused_rather_than_guessed() -> None:
    with pytest.raises(ProblemError, match="end requires an offset from UTC"):
        ns_from_datetime(datetime(2026, 1, 1), "end")
