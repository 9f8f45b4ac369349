"""Conversion of file times to UTC in ns, rounded to whole µs; import of optional libraries."""

import importlib
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta, timezone
from typing import Any

import numpy as np
import numpy.typing as npt

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import TimeAxis

TimeArray = npt.NDArray[np.int64]

_US_PER = {"s": 1e6, "ms": 1e3, "us": 1.0, "ns": 1e-3}
_MAX_US = 2**53
"""Maximum time, 285 years: beyond it a double of seconds is not exact to 1 µs, and nanoseconds
since 1970 overflow 64 bits."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)


def numbers_to_ns(values: npt.NDArray[Any], axis: TimeAxis, start_ns: int | None) -> TimeArray:
    """Convert the numbers (n,) of a time column to UTC in nanoseconds.

    The form of the time axis states the unit of the numbers. `start_ns` is the origin of "elapsed"
    times, UTC in nanoseconds since 1970; None if it is not known.

    Raises ConfigError if a value is not a valid time, or the start of "elapsed" times is missing.
    """
    origin, _, unit = axis.form.partition("_")
    if origin == "epoch":
        start_ns = -axis.utc_offset_s * 1_000_000_000
    if start_ns is None:
        raise ConfigError("the elapsed times have no origin; set start under [time] in the mapping")
    return utc_ns(_whole_us(values, _US_PER[unit]), start_ns)


def utc_ns(us: TimeArray, start_ns: int) -> TimeArray:
    """Convert whole microseconds since `start_ns` (UTC in ns since 1970) to UTC in nanoseconds.

    Raises ConfigError if a time is too far from 1970 for nanoseconds in 64 bits.
    """
    found = us + np.int64(start_ns // 1000)
    wrong = np.abs(found) >= _MAX_US
    if wrong.any():
        time_s, most_s = found[wrong][0] / 1e6, _MAX_US / 1e6
        raise ConfigError(f"time {time_s:.6g} s since 1970 is out of range: ±{most_s:.3g} s")
    return found * 1000


def _whole_us(values: npt.NDArray[Any], us_per_unit: float) -> TimeArray:
    if values.dtype.kind in "iu" and us_per_unit < 1.0:  # a double cannot hold epoch nanoseconds
        return np.asarray(values // 1000 + (values % 1000 >= 500)).astype(np.int64)
    exact = np.rint(values.astype(np.float64) * us_per_unit)
    wrong = ~(np.abs(exact) < _MAX_US)  # NaN is wrong, too
    if wrong.any():
        raise ConfigError(f"value {values[wrong][0]} of the time column is not a valid time")
    return exact.astype(np.int64)


def text_to_ns(texts: Sequence[str], axis: TimeAxis) -> TimeArray:
    """Convert ISO 8601 texts to UTC in ns, (n,); the default time zone is that of `axis`.

    Raises ConfigError if a text is not a valid time.
    """
    zone = timezone(timedelta(seconds=axis.utc_offset_s))
    return utc_ns(np.array([_text_to_us(text, zone) for text in texts], dtype=np.int64), 0)


def _text_to_us(text: str, zone: timezone) -> int:
    try:
        time = datetime.fromisoformat(text.strip())
    except ValueError as error:
        words = "of the time column is not an ISO 8601 time such as 2026-05-01T12:00:00.000Z"
        raise ConfigError(f"{text[:40]!r} {words}") from error
    if time.tzinfo is None:
        time = time.replace(tzinfo=zone)
    return (time - _EPOCH) // _MICROSECOND


def from_start(start_ns: int, first: int, stop: int, rate_hz: float) -> TimeArray:
    """Return the times of samples `first` to `stop` (excluded) at a constant rate, UTC in ns.

    Sample 0 is at `start_ns`.
    """
    number = np.arange(first, stop, dtype=np.float64)
    return utc_ns(np.floor(number * (1e6 / rate_hz)).astype(np.int64), start_ns)


def library(name: str, what: str) -> Any:
    """Import an optional library and return it; `what` names the file format in the error.

    Raises ConfigError if the library is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ConfigError(
            f"importing {what} requires {name}; run pip install 'padwatch[imports]'"
        ) from error
