"""Trend queries, answered from as few roll-ups and single readings as possible."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from service.store.buckets import (
    IntArray,
    Summaries,
    bucket_width_ns,
    bucketed,
    page,
    single_points,
)
from service.store.database import Connection
from service.store.port import Trend, TrendQuery
from service.store.rollups.rows import ANYTHING, HOUR_NS, WIDTHS_NS, Cells, Conditions, select_cells
from service.store.rollups.writing import DeletedUntil, select_deleted, select_mark
from service.store.series import find_series
from service.store.trends import Span, arguments, select_page, select_readings, storable, too_large

MAX_SPANS = 4096
"""Maximum number of roll-up spans that one SQL query reads, to limit memory."""

MAX_CUT_SPANS = 100_000
"""Maximum number of finer roll-ups read where wider roll-ups match a query only in part."""

REDONE = """
    SELECT start_ns FROM rollup_redo
    WHERE series = ? AND start_ns >= ? AND start_ns < ? ORDER BY start_ns
"""


@dataclass
class Cover:
    """Roll-ups and time spans that together answer a query.

    Parameters
    ----------
    summaries
        Roll-ups, aggregated into buckets, all of whose readings match the query.
    spans
        Time spans for which single readings must be read.
    rolled_spans
        Time spans of the roll-ups.
    n_rolled
        Number of readings in the roll-ups, usable or not.
    is_coarse
        Whether the single readings of some roll-ups were deleted.
    """

    summaries: list[Summaries] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)
    rolled_spans: list[Span] = field(default_factory=list)
    n_rolled: int = 0
    is_coarse: bool = False


def covered(
    reader: Connection,
    query: TrendQuery,
    deleted: DeletedUntil,
    whole: Span,
    bucket_ns: int,
) -> Cover:
    """Return the roll-ups and the spans of single readings that cover a time range.

    Where single readings were deleted, roll-ups that extend beyond the range are included as a
    whole, and roll-ups that match the bounds of the conditions only in part are omitted.

    Parameters
    ----------
    deleted
        Times up to which data of the bearing were deleted.
    whole
        Requested half-open time range, ns since 1970 UTC.
    bucket_ns
        Width of the requested buckets.

    Raises
    ------
    QueryTooLargeError
        If too many roll-ups match the bounds of the conditions only in part.
    """
    series = find_series(reader, query.unit, query.bearing)
    if series is None:
        return Cover()
    covering = _Covering(reader, query, series, bucket_ns)
    for stretch in deleted.stretches(whole):
        if stretch[0] < deleted.readings_ns:
            covering.take_coarse(
                stretch, [w for w in deleted.kept_ns(stretch[0]) if bucket_ns % w == 0]
            )
        else:
            covering.take(stretch, [w for w in WIDTHS_NS if bucket_ns % w == 0])
    covering.cover.spans.sort()
    return covering.cover


class _Covering:
    def __init__(self, reader: Connection, query: TrendQuery, series: int, bucket_ns: int) -> None:
        self._reader, self._series, self._bucket_ns = reader, series, bucket_ns
        self._names = query.quantities
        self._mark_ns = select_mark(reader, series)
        conditions = arguments(query)
        self._asked = {name: conditions[name] for name in ANYTHING}
        self._n_cut = 0
        self.cover = Cover()

    def take(self, span: Span, widths_ns: Sequence[int], *, is_coarse: bool = False) -> None:
        """Cover a span by the widest roll-ups, its ends by finer roll-ups or single readings.

        `widths_ns` are the available widths, finest first. With `is_coarse`, single readings no
        longer exist, and the finest roll-ups may extend beyond the span.
        """
        if span[0] >= span[1]:
            return
        if not widths_ns:
            self.cover.spans.append(span)
            return
        width_ns, finer_ns = widths_ns[-1], widths_ns[:-1]
        if is_coarse:
            inner = _inside(span, width_ns) if finer_ns else _around(span, width_ns)
        else:
            inner = _inside((span[0], min(span[1], self._mark_ns)), width_ns)
        if inner[0] >= inner[1]:
            self.take(span, finer_ns, is_coarse=is_coarse)
            return
        for edge in ((span[0], inner[0]), (inner[1], span[1])):
            self.take(edge, finer_ns, is_coarse=is_coarse)
        for start_ns in range(inner[0], inner[1], MAX_SPANS * width_ns):
            some = _within(inner, (start_ns, start_ns + MAX_SPANS * width_ns))
            self._take_inner(some, width_ns, finer_ns, is_coarse=is_coarse)

    def take_coarse(self, span: Span, widths_ns: Sequence[int]) -> None:
        """Cover a span without single readings by roll-ups, and by readings that arrived late."""
        self.take(span, widths_ns, is_coarse=True)
        late = self._redone(span)
        self.cover.spans += [_within(span, (hour, hour + HOUR_NS)) for hour in late]

    def _note_cut(self, n_finer: int) -> None:
        self._n_cut += n_finer
        if self._n_cut > MAX_CUT_SPANS:
            raise too_large()

    def _cells(self, span: Span, width_ns: int) -> Cells | None:
        arguments = (self._reader, self._series, width_ns, span, self._names, self._asked)
        return select_cells(*arguments, has_conditions=self._asked != ANYTHING)

    def _take_inner(
        self, inner: Span, width_ns: int, finer_ns: Sequence[int], *, is_coarse: bool
    ) -> None:
        redone = [] if is_coarse else self._redone(inner)
        self.cover.spans += [_within(inner, (hour, hour + HOUR_NS)) for hour in redone]
        cells = self._cells(inner, width_ns)
        if cells is None:
            return
        self.cover.is_coarse |= is_coarse
        time_ns, is_cut = cells.summaries.time_ns, self._cut(cells.conditions)
        if is_coarse and not finer_ns:
            self._use(cells, ~is_cut, width_ns)
            return
        is_redone = np.isin(time_ns // HOUR_NS * HOUR_NS, redone)
        is_cut = np.isin(time_ns, time_ns[is_cut])
        self._use(cells, ~is_redone & ~is_cut, width_ns)
        for cut in _runs(np.unique(time_ns[is_cut & ~is_redone]), width_ns):
            self._note_cut((cut[1] - cut[0]) // finer_ns[-1] if finer_ns else 0)
            self.take(cut, finer_ns, is_coarse=is_coarse)

    def _redone(self, inner: Span) -> list[int]:
        first_ns = inner[0] // HOUR_NS * HOUR_NS
        return [row[0] for row in self._reader.execute(REDONE, (self._series, first_ns, inner[1]))]

    def _use(self, cells: Cells, rows: npt.NDArray[np.bool_], width_ns: int) -> None:
        if rows.any():
            chosen = cells.summaries if rows.all() else cells.summaries.at(rows)
            self.cover.summaries.append(chosen.in_spans(self._bucket_ns))
            self.cover.n_rolled += int(cells.conditions.n_readings[rows].sum())
            self.cover.rolled_spans += _runs(np.unique(chosen.time_ns), width_ns)

    def _cut(self, conditions: Conditions) -> npt.NDArray[np.bool_]:
        """Return a mask of the cells that the bounds of the conditions may match only in part."""
        asked = self._asked
        sides = (
            (asked["eccentricity_low"], conditions.eccentricity_low, -1.0),
            (asked["eccentricity_high"], conditions.eccentricity_high, 1.0),
            (asked["oil_low"], conditions.oil_low_c, -1.0),
            (asked["oil_high"], conditions.oil_high_c, 1.0),
        )
        is_cut = np.zeros(conditions.state.size, dtype=np.bool_)
        for bound, extreme, sign in sides:
            if isinstance(bound, int | float):
                is_cut |= sign * extreme > sign * bound
        return is_cut


def _within(span: Span, other: Span) -> Span:
    return max(span[0], other[0]), min(span[1], other[1])


def _inside(span: Span, width_ns: int) -> Span:
    return -(-span[0] // width_ns) * width_ns, span[1] // width_ns * width_ns


def _around(span: Span, width_ns: int) -> Span:
    return span[0] // width_ns * width_ns, -(-span[1] // width_ns) * width_ns


def _runs(time_ns: IntArray, width_ns: int) -> Iterator[Span]:
    """Yield the span of each run of contiguous buckets, given the sorted bucket starts."""
    breaks = np.flatnonzero(np.diff(time_ns) > width_ns)
    if time_ns.size:
        firsts = np.concatenate([time_ns[:1], time_ns[breaks + 1]]).tolist()
        lasts = np.concatenate([time_ns[breaks], time_ns[-1:]]).tolist()
        for first_ns, last_ns in zip(firsts, lasts, strict=True):
            yield first_ns, last_ns + width_ns


def read_trend(reader: Connection, query: TrendQuery) -> Trend:
    """Return the trends of one bearing: a page, or at most ``max_points`` readings or buckets.

    Raises `QueryTooLargeError` if too many single readings would have to be read.
    """
    series = find_series(reader, query.unit, query.bearing)
    deleted = DeletedUntil({}) if series is None else select_deleted(reader, series)
    whole = (storable(query.start_ns), storable(query.end_ns))
    coarse_ns = deleted.readings_ns if whole[0] < deleted.readings_ns else None
    if query.is_page:
        found = page(select_page(reader, query), query.max_points, query.hole_ns)
    else:
        finest_ns = deleted.finest_ns(whole[0]) or 1
        width_ns = bucket_width_ns(*whole, query.max_points, finest_ns)
        found = _read(reader, query, deleted, whole, width_ns)
    return replace(found, coarse_until_ns=coarse_ns)


def _read(
    reader: Connection, query: TrendQuery, deleted: DeletedUntil, whole: Span, width_ns: int
) -> Trend:
    cover = covered(reader, query, deleted, whole, width_ns)
    n_single, singles = select_readings(reader, query, cover.spans, width_ns)
    if cover.is_coarse or cover.n_rolled + n_single > query.max_points:
        return bucketed(Summaries.together([*cover.summaries, singles]), width_ns)
    if cover.n_rolled:
        spans = sorted([*cover.spans, *cover.rolled_spans])
        _, singles = select_readings(reader, query, spans, width_ns)
    return single_points(singles, query.hole_ns)
