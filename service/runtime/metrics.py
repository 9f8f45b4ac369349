"""Prometheus metric families, histograms of durations, and their text exposition format."""

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import accumulate
from threading import Lock

from prometheus_client import exposition
from prometheus_client.metrics_core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.openmetrics import exposition as open_exposition
from prometheus_client.registry import Collector

from acquisition.clock import Clock


@dataclass(frozen=True)
class HistogramState:
    """Snapshot of a histogram of durations.

    Parameters
    ----------
    bounds_s
        Upper bounds of the buckets.
    n_up_to
        Number of durations up to each bound; the last element is the number of all durations.
    newest_s
        Last duration; None before the first duration.
    """

    bounds_s: tuple[float, ...]
    n_up_to: tuple[int, ...]
    sum_s: float
    newest_s: float | None = None


class Durations:
    """Histogram of durations; thread-safe.

    Parameters
    ----------
    bounds_s
        Upper bounds of the buckets, increasing.

    Raises
    ------
    ValueError
        If the bounds do not increase.
    """

    def __init__(self, bounds_s: Sequence[float], clock: Clock) -> None:
        if not bounds_s or list(bounds_s) != sorted(set(bounds_s)):
            raise ValueError(f"bounds of buckets must increase, got {list(bounds_s)}")
        self._bounds_s, self._clock = tuple(bounds_s), clock
        self._n_in = [0] * (len(bounds_s) + 1)
        self._sum_s = 0.0
        self._newest_s: float | None = None
        self._lock = Lock()

    def observe(self, duration_s: float) -> None:
        """Add a duration to the histogram."""
        place = bisect_left(self._bounds_s, duration_s)
        with self._lock:
            self._n_in[place] += 1
            self._sum_s += duration_s
            self._newest_s = duration_s

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Measure and add the duration of a `with` block, unless the block raises."""
        began_s = self._clock.monotonic_s()
        yield
        self.observe(self._clock.monotonic_s() - began_s)

    def state(self) -> HistogramState:
        """Return a snapshot of the histogram."""
        with self._lock:
            n_up_to = tuple(accumulate(self._n_in))
            return HistogramState(self._bounds_s, n_up_to, self._sum_s, self._newest_s)


Rows = Iterable[tuple[tuple[str, ...], float]]
"""Samples of a metric family: label values in the order of the labels, and the sample value."""


def gauge(name: str, meaning: str, labels: tuple[str, ...], rows: Rows) -> Metric:
    """Return the gauge family ``padwatch_`` + `name` with the help text `meaning`."""
    family = GaugeMetricFamily(f"padwatch_{name}", meaning, labels=labels)
    for values, number in rows:
        family.add_metric(values, number)
    return family


def counter(name: str, meaning: str, labels: tuple[str, ...], rows: Rows) -> Metric:
    """Return the counter family ``padwatch_`` + `name` + ``_total``, with help text `meaning`."""
    family = CounterMetricFamily(f"padwatch_{name}", meaning, labels=labels)
    for values, number in rows:
        family.add_metric(values, number)
    return family


def histogram(name: str, meaning: str, durations: Mapping[str, Durations]) -> Metric:
    """Return a histogram family with the label ``unit``, from histograms by unit id."""
    family = HistogramMetricFamily(f"padwatch_{name}", meaning, labels=("unit",))
    for unit, its in durations.items():
        family.add_metric((unit,), *_buckets(its.state()))
    return family


def plain_histogram(name: str, meaning: str, durations: Durations) -> Metric:
    """Return a histogram family without labels, from one histogram."""
    return HistogramMetricFamily(f"padwatch_{name}", meaning, *_buckets(durations.state()))


def _buckets(state: HistogramState) -> tuple[list[tuple[str, float]], float]:
    """Return the buckets (upper bound as text, cumulative count) and the sum of a histogram."""
    bounds = [*map(repr, state.bounds_s), "+Inf"]
    return list(zip(bounds, map(float, state.n_up_to), strict=True)), state.sum_s


TEXT = exposition.CONTENT_TYPE_PLAIN_0_0_4
OPEN_METRICS = "application/openmetrics-text; version=1.0.0; charset=utf-8"


def rendered(metrics: Collector, accept: str) -> tuple[bytes, str]:
    """Return metrics in the OpenMetrics or Prometheus text format, and the media type of the text.

    Parameters
    ----------
    accept
        ``Accept`` header of the request. The content negotiation of `prometheus_client` is not
        used, because the media type that it returns repeats parts of the header.
    """
    if "application/openmetrics-text" in accept.lower():
        text: bytes = open_exposition.generate_latest(metrics)  # type: ignore[no-untyped-call]
        return text, OPEN_METRICS
    return exposition.generate_latest(metrics), TEXT
