"""Trends out of roll-ups and rows: as buckets, or as single readings where they are few."""

from dataclasses import replace

from service.store.buckets import bucket_width_ns, bucketed, page, single_points
from service.store.database import Connection
from service.store.port import Trend, TrendQuery
from service.store.retention.marks import Gone, select_gone
from service.store.rollups.cover import Cover, covered, select_series
from service.store.summaries import Summaries
from service.store.trends import Span, select_page, select_readings, storable


def read_trend(reader: Connection, query: TrendQuery) -> Trend:
    """Read trends of one bearing, gathered into buckets if they are many.

    Raises
    ------
    QueryTooLargeError
        If more single readings would have to be read than can be.
    """
    gone = _gone(reader, query)
    whole = (storable(query.start_ns), storable(query.end_ns))
    coarse_ns = gone.readings_ns if whole[0] < gone.readings_ns else None
    if query.is_page:
        found = page(select_page(reader, query), query.max_points, query.hole_ns)
    else:
        finest_ns = gone.finest_ns(whole[0]) or 1
        width_ns = bucket_width_ns(*whole, query.max_points, finest_ns)
        found = _read(reader, query, gone, whole, width_ns)
    return replace(found, coarse_until_ns=coarse_ns)


def _gone(reader: Connection, query: TrendQuery) -> Gone:
    series = select_series(reader, query)
    return Gone({}) if series is None else select_gone(reader, series)


def _read(reader: Connection, query: TrendQuery, gone: Gone, whole: Span, width_ns: int) -> Trend:
    cover = covered(reader, query, gone, whole, width_ns)
    n_single, singles = select_readings(reader, query, cover.spans, width_ns)
    if cover.is_coarse or cover.n_rolled + n_single > query.max_points:
        return bucketed(Summaries.together([*cover.summaries, singles]), width_ns)
    if cover.n_rolled:
        _, singles = select_readings(reader, query, _all_spans(cover), width_ns)
    return single_points(singles, query.hole_ns)


def _all_spans(cover: Cover) -> list[Span]:
    return sorted([*cover.spans, *cover.rolled_spans])
