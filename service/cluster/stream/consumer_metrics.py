"""Metrics of what is read from the stream."""

from collections.abc import Iterator

from prometheus_client.metrics_core import Metric

from service.cluster.stream.consumer import Consumer
from service.runtime.metrics import counter, gauge

UNIT = ("unit",)


def consumer_metrics(consumer: Consumer) -> Iterator[Metric]:
    """How far behind the stream each unit is, and what was refused."""
    yield gauge(
        "stream_connected",
        "1 while blocks are read from the servers of the stream.",
        (),
        [((), consumer.trouble is None)],
    )
    yield gauge(
        "stream_pending",
        "Messages of the unit that are on the stream and were not fetched yet.",
        UNIT,
        (((unit,), n) for unit, n in consumer.n_pending.items()),
    )
    yield gauge(
        "stream_analysis_behind_seconds",
        "How far behind its device the block of the unit was that was taken in last.",
        UNIT,
        (((unit,), its.behind_s) for unit, its in consumer.units.items()),
    )
    yield counter(
        "stream_refused",
        "Messages of the unit that could not be used, by reason.",
        ("unit", "reason"),
        (
            ((unit, kind), n)
            for unit, its in consumer.units.items()
            for kind, n in its.refused.items()
        ),
    )
    yield counter(
        "stream_redelivered",
        "Messages of the unit that came a second time, and counted once.",
        UNIT,
        (((unit,), its.n_repeated) for unit, its in consumer.units.items()),
    )
