"""Families of metrics, one line each: name, meaning, labels, values."""

from collections.abc import Iterable, Mapping

from prometheus_client import exposition
from prometheus_client.metrics_core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.openmetrics import exposition as open_exposition
from prometheus_client.registry import Collector

from service.runtime.durations import Durations, Seen

Rows = Iterable[tuple[tuple[str, ...], float]]
"""Values of labels, in order, with the number."""


def gauge(name: str, meaning: str, labels: tuple[str, ...], rows: Rows) -> Metric:
    """Something that goes up and down."""
    family = GaugeMetricFamily(f"padwatch_{name}", meaning, labels=labels)
    for values, number in rows:
        family.add_metric(values, number)
    return family


def counter(name: str, meaning: str, labels: tuple[str, ...], rows: Rows) -> Metric:
    """Something that only grows while the service runs; `_total` is added to its name."""
    family = CounterMetricFamily(f"padwatch_{name}", meaning, labels=labels)
    for values, number in rows:
        family.add_metric(values, number)
    return family


def histogram(name: str, meaning: str, durations: Mapping[str, Durations]) -> Metric:
    """Durations by unit."""
    family = HistogramMetricFamily(f"padwatch_{name}", meaning, labels=("unit",))
    for unit, its in durations.items():
        seen = its.seen()
        family.add_metric((unit,), buckets(seen), seen.sum_s)
    return family


def plain_histogram(name: str, meaning: str, durations: Durations) -> Metric:
    """Durations of one thing."""
    seen = durations.seen()
    return HistogramMetricFamily(f"padwatch_{name}", meaning, buckets(seen), seen.sum_s)


def buckets(seen: Seen) -> list[tuple[str, float]]:
    """Bounds as Prometheus writes them, each with how many lie at or below it."""
    bounds = [*(repr(bound) for bound in seen.bounds_s), "+Inf"]
    return [(bound, float(n)) for bound, n in zip(bounds, seen.n_up_to, strict=True)]


TEXT = exposition.CONTENT_TYPE_PLAIN_0_0_4


OPEN_METRICS = "application/openmetrics-text; version=1.0.0; charset=utf-8"


def rendered(metrics: Collector, accept: str) -> tuple[bytes, str]:
    """Metrics as text with its media type.

    Parameters
    ----------
    accept
        What the client takes. The library's own choice is not used: it repeats parts of what the
        client has sent in its answer.
    """
    if "application/openmetrics-text" in accept.lower():
        text: bytes = open_exposition.generate_latest(metrics)  # type: ignore[no-untyped-call]
        return text, OPEN_METRICS
    return exposition.generate_latest(metrics), TEXT
