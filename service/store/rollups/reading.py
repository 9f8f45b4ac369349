"""Trends out of roll-ups and rows: as buckets, or as single readings where they are few."""

from service.store.buckets import bucket_width_ns, bucketed, page, single_points
from service.store.database import Connection
from service.store.port import Trend, TrendQuery
from service.store.rollups.cover import Cover, covered
from service.store.rollups.widths import WIDTHS_NS
from service.store.summaries import Summaries
from service.store.trends import Span, select_page, select_readings, storable


def read_trend(reader: Connection, query: TrendQuery) -> Trend:
    """Read trends of one bearing, gathered into buckets if they are many.

    Raises
    ------
    QueryTooLargeError
        If more single readings would have to be read than can be.
    """
    if query.is_page:
        return page(select_page(reader, query), query.max_points, query.hole_ns)
    whole = (storable(query.start_ns), storable(query.end_ns))
    width_ns = bucket_width_ns(*whole, query.max_points)
    return _read(reader, query, whole, width_ns)


def _read(reader: Connection, query: TrendQuery, whole: Span, width_ns: int) -> Trend:
    fitting_ns = [width for width in WIDTHS_NS if width_ns % width == 0]
    cover = covered(reader, query, whole, fitting_ns, width_ns)
    n_single, singles = select_readings(reader, query, cover.spans, width_ns)
    if cover.n_rolled + n_single > query.max_points:
        return bucketed(Summaries.together([*cover.summaries, singles]), width_ns)
    if cover.n_rolled:
        _, singles = select_readings(reader, query, _all_spans(cover), width_ns)
    return single_points(singles, query.hole_ns)


def _all_spans(cover: Cover) -> list[Span]:
    return sorted([*cover.spans, *cover.rolled_spans])
