"""Query parameters of several routes: times, ranges of values, operating states."""

from datetime import UTC, datetime
from typing import Annotated, Any

from fastapi import Depends, Query, Request
from pydantic import BeforeValidator

from core.units import NS_PER_S
from service.api.problems import ProblemError
from service.api.values import OperatingStateName
from service.runtime.times import EPOCH, rfc3339
from service.store.port import ValueRange

FIRST, LAST = datetime.min.replace(tzinfo=UTC), datetime.max.replace(tzinfo=UTC)


def written_as_date(text: object) -> object:
    """Return the written time unchanged; a number is rejected, since its unit is unknown.

    Raises `ValueError` if the value is a number, or a text that is one.
    """
    if not isinstance(text, str) or "-" not in text[1:]:
        raise ValueError("a time must be RFC 3339, such as 2026-11-21T08:00:00Z")
    return text


def ns_from_datetime(moment: datetime, parameter: str) -> int:
    """Return a time in nanoseconds since 1970 UTC, clipped to the years 1 to 9999.

    `parameter` is the name of the request parameter with the time, for the error. Raises
    `ProblemError` if the time has no offset from UTC.
    """
    if moment.tzinfo is None:
        detail = f"{parameter} requires an offset from UTC, such as a trailing Z"
        raise ProblemError(422, "Wrong parameter", detail, parameter)
    elapsed = min(max(moment, FIRST), LAST) - EPOCH
    return (elapsed.days * 86_400 + elapsed.seconds) * NS_PER_S + elapsed.microseconds * 1000


def require_order(start_ns: int, end_ns: int) -> None:
    """Require that the start of a time range is before its end.

    Raises `ProblemError` if the start is not before the end.
    """
    if start_ns >= end_ns:
        detail = f"start {rfc3339(start_ns)} must be before end {rfc3339(end_ns)}"
        raise ProblemError(422, "Wrong parameter", detail, "start")


Moment = Annotated[datetime, BeforeValidator(written_as_date)]


def parameter(description: str, example: Any, **options: Any) -> Any:
    """Return the declaration of a query parameter; `options` are those of `fastapi.Query`."""
    return Query(description=description, examples=[example], **options)


_START = parameter("Start, RFC 3339 with offset.", "2026-11-21T08:00:00Z")
_END = parameter("End, RFC 3339 with offset.", "2026-11-21T09:00:00Z")


def duration(longest_s: float, description: str, **options: Any) -> Any:
    """Return the declaration of a query parameter for a duration of at most `longest_s` seconds.

    `options` are further keyword arguments of `fastapi.Query`.
    """
    return Query(gt=0.0, le=longest_s, allow_inf_nan=False, description=description, **options)


def at_most(maximum: int, words: str, minimum: int = 1) -> Any:
    """Return the declaration of a query parameter for the maximum number of `words`."""
    return Query(ge=minimum, le=maximum, description=f"Maximum number of {words}.")


def several(words: str, examples: list[str], max_length: int) -> Any:
    """Return the declaration of a query parameter for at most `max_length` values, default all."""
    return parameter(f"{words}; default: all. May be repeated.", examples, max_length=max_length)


SECONDS = {"min": 60, "h": 3600, "d": 86_400}
MINUTE_NS = 60 * NS_PER_S


async def time_range(
    request: Request,
    start: Annotated[Moment | None, _START] = None,
    end: Annotated[Moment | None, _END] = None,
    last: Annotated[
        str | None,
        parameter(
            "Length of the range in place of start: minutes, hours or days.",
            "24h",
            pattern=r"^[1-9][0-9]{0,4}(min|h|d)$",
        ),
    ] = None,
) -> tuple[int, int]:
    """Return start and end of the requested time range, nanoseconds since 1970 UTC.

    Without an end, the range ends at the next whole minute, so that answers can be cached.

    Raises `ProblemError` unless exactly one of `start` and `last` is given, or if the start is not
    before the end.
    """
    if (start is None) == (last is None):
        detail = "exactly one of start and last, such as last=24h, is required"
        raise ProblemError(422, "Wrong parameter", detail, "start")
    now_ns = request.app.state.clock.now_ns()
    end_ns = ns_from_datetime(end, "end") if end else (now_ns // MINUTE_NS + 1) * MINUTE_NS
    if start is not None:
        start_ns = ns_from_datetime(start, "start")
    else:
        text = str(last)
        number = text.rstrip("minhd")
        start_ns = end_ns - int(number) * SECONDS[text.removeprefix(number)] * NS_PER_S
    require_order(start_ns, end_ns)
    return start_ns, end_ns


async def optional_time_range(
    start: Annotated[Moment | None, _START] = None, end: Annotated[Moment | None, _END] = None
) -> tuple[int, int]:
    """Check and return start and end of a time range, ns since 1970 UTC; unlimited by default."""
    start_ns = ns_from_datetime(start, "start") if start else -(2**63)
    end_ns = ns_from_datetime(end, "end") if end else 2**63 - 1
    require_order(start_ns, end_ns)
    return start_ns, end_ns


def range_of(name: str, words: str, low: float, high: float) -> Any:
    """Return the dependency on the parameters ``name_min`` and ``name_max``: a `ValueRange`.

    `words` name the quantity with its unit; `low` and `high` are examples of the bounds.
    """

    def bound(end: str, example: float) -> Any:
        alias = f"{name}_{end[:3].lower()}"
        return parameter(f"{end} {words}.", example, alias=alias, allow_inf_nan=False)

    async def given(
        minimum: Annotated[float | None, bound("Minimum", low)] = None,
        maximum: Annotated[float | None, bound("Maximum", high)] = None,
    ) -> ValueRange:
        if minimum is not None and maximum is not None and minimum > maximum:
            detail = f"must be at most {maximum:g}, the requested maximum, got {minimum:g}"
            raise ProblemError(422, "Wrong parameter", f"{name}_min {detail}", f"{name}_min")
        return ValueRange(minimum, maximum)

    return Depends(given)


TimeRange = Annotated[tuple[int, int], Depends(time_range)]
OptionalTimeRange = Annotated[tuple[int, int], Depends(optional_time_range)]
Eccentricity = Annotated[ValueRange, range_of("eccentricity", "eccentricity ratio", 0.2, 0.4)]
OilTemperature = Annotated[ValueRange, range_of("oil_temperature", "temperature, °C", 40.0, 50.0)]
Attitude = Annotated[ValueRange, range_of("attitude", "attitude angle, degrees", 40.0, 50.0)]


States = Annotated[
    list[OperatingStateName] | None,
    parameter("Operating state to include; may be repeated.", ["full_load"]),
]

OnlyUnit = Annotated[str | None, parameter("Unit to include; default: all.", "U1", max_length=32)]


def only(description: str, example: str, max_length: int | None = None) -> Any:
    """Return the declaration of a query parameter that selects entries by one property."""
    return parameter(f"Only this {description}.", example, max_length=max_length)
