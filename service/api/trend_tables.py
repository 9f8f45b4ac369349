"""Trends as tables: a row for each time, columns for each quantity."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TypeVar

from core.monitor.catalogue import BY_NAME
from service.api.tables import Column
from service.api.trend_groups import TrendGroup
from service.api.views import LEVEL_NAMES
from service.store.port import Trend, TrendSeries
from service.store.series import U_RANDOM, U_SYSTEMATIC

T = TypeVar("T")


def trend_table(
    trend: Trend, groups: Sequence[TrendGroup] | None, past_end_ns: int | None
) -> list[Column]:
    """Columns of a trend; with groups, theirs below each other instead of the whole.

    Parameters
    ----------
    past_end_ns
        Until when the bearing's past is simulated.
    """
    parts = [trend] if groups is None else [group.trend for group in groups]
    times = [time_ns for part in parts for time_ns in part.time_ns]
    simulated = [past_end_ns is not None and time_ns <= past_end_ns for time_ns in times]
    columns = [Column("time_utc", "time", times), Column("is_simulated", "flag", simulated)]
    if groups is not None:
        names = [group.name for group in groups for _ in group.trend.time_ns]
        columns.insert(0, Column("group", "text", names))
    for name in filter(BY_NAME.__contains__, trend.series):
        columns += _columns(name, [part.series for part in parts])
    return columns


def _columns(name: str, parts: Sequence[Mapping[str, TrendSeries]]) -> Iterator[Column]:
    unit, own = BY_NAME[name].unit, [part[name] for part in parts]
    for kind in ("minimum", "maximum", "mean"):
        values = _joined(getattr(series, kind) for series in own)
        yield Column(f"{name}_{kind}", "number", values, unit)
    yield Column(f"{name}_count", "count", _joined(series.count for series in own))
    levels = _joined(series.worst_level for series in own)
    words = [None if level is None else LEVEL_NAMES[level] for level in levels]
    yield Column(f"{name}_worst_level", "text", words)
    for suffix in (U_RANDOM, U_SYSTEMATIC):
        if all(name + suffix in part for part in parts) and parts:
            values = _joined(part[name + suffix].mean for part in parts)
            yield Column(f"{name}_{suffix.lstrip('.')}", "number", values, unit)


def _joined(parts: Iterable[Sequence[T]]) -> list[T]:
    return [value for part in parts for value in part]
