"""Times at the API: RFC 3339 outside, nanoseconds inside."""

from datetime import UTC, datetime, timedelta, timezone

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.api.problems import ProblemError
from service.api.times import ns_from_datetime, rfc3339

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
    with pytest.raises(ProblemError, match="end needs an offset from UTC"):
        ns_from_datetime(datetime(2026, 1, 1), "end")
