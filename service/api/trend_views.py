"""Trends in the words of the API, by column."""

from collections.abc import Iterable, Mapping

from core.monitor.catalogue import BY_NAME
from core.units import NS_PER_S
from service.api.series_models import TrendGroupModel, TrendModel, TrendSeriesModel
from service.api.trend_groups import TrendGroup
from service.api.views import LEVEL_NAMES
from service.runtime.times import rfc3339
from service.store.port import Trend, TrendQuery, TrendSeries
from service.store.series import U_RANDOM, U_SYSTEMATIC, columns_of


def trend_model(
    query: TrendQuery,
    trend: Trend,
    groups: list[TrendGroup] | None = None,
    past_end_ns: int | None = None,
) -> TrendModel:
    """Trends by column, and those of each condition where they were asked for.

    Parameters
    ----------
    past_end_ns
        Until when the bearing's past is simulated.
    """
    return TrendModel(
        unit=query.unit,
        bearing=query.bearing,
        start=rfc3339(query.start_ns),
        end=rfc3339(query.end_ns),
        bucket_s=bucket_s(trend),
        simulated_until=simulated_until(query, past_end_ns),
        coarse_until=None if trend.coarse_until_ns is None else rfc3339(trend.coarse_until_ns),
        next_cursor=None if trend.next_ns is None else str(trend.next_ns),
        time=times_s(trend),
        series=_series_models(trend),
        groups=None if groups is None else [_group_model(group) for group in groups],
    )


def simulated_until(query: TrendQuery, past_end_ns: int | None) -> str | None:
    """Until when readings of a range are simulated; None where all are measured."""
    if past_end_ns is None or past_end_ns < query.start_ns:
        return None
    return rfc3339(past_end_ns)


def _group_model(group: TrendGroup) -> TrendGroupModel:
    return TrendGroupModel(
        name=group.name,
        low=group.low,
        high=group.high,
        bucket_s=bucket_s(group.trend),
        time=times_s(group.trend),
        series=_series_models(group.trend),
    )


def bucket_s(trend: Trend) -> float | None:
    """Width of the buckets."""
    return None if trend.bucket_ns is None else trend.bucket_ns / NS_PER_S


def times_s(trend: Trend) -> list[float]:
    """Seconds since 1970."""
    return [time_ns / NS_PER_S for time_ns in trend.time_ns]


def _series_models(trend: Trend) -> dict[str, TrendSeriesModel]:
    return {name: _series_model(name, trend.series) for name in trend.series if name in BY_NAME}


def trend_columns(quantities: Iterable[str]) -> tuple[str, ...]:
    """Columns of the store that a trend of some quantities needs."""
    return columns_of(BY_NAME[name] for name in quantities)


def _series_model(name: str, columns: Mapping[str, TrendSeries]) -> TrendSeriesModel:
    series = columns[name]
    random, systematic = columns.get(name + U_RANDOM), columns.get(name + U_SYSTEMATIC)
    return TrendSeriesModel(
        unit=BY_NAME[name].unit,
        min=list(series.minimum),
        max=list(series.maximum),
        mean=list(series.mean),
        count=list(series.count),
        worst_level=[None if level is None else LEVEL_NAMES[level] for level in series.worst_level],
        u_random=list(random.mean) if random else None,
        u_systematic=list(systematic.mean) if systematic else None,
    )
