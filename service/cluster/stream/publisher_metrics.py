"""Metrics of what is published."""

from collections.abc import Iterator

from prometheus_client.metrics_core import Metric

from service.cluster.stream.publisher import Publisher
from service.runtime.metrics import counter, gauge


def publisher_metrics(publisher: Publisher) -> Iterator[Metric]:
    """What waits for the servers, and what they have."""
    waiting = publisher.waiting
    yield gauge(
        "stream_connected",
        "1 while blocks are taken by the servers of the stream.",
        (),
        [((), publisher.trouble is None)],
    )
    yield counter(
        "stream_published",
        "Messages that the servers have confirmed.",
        (),
        [((), waiting.n_published)],
    )
    yield counter(
        "stream_repeated",
        "Messages that were sent again because they were not confirmed.",
        (),
        [((), publisher.n_repeated)],
    )
    yield counter(
        "stream_doubles",
        "Messages that the servers had already, and kept once.",
        (),
        [((), publisher.n_doubles)],
    )
    yield gauge(
        "stream_waiting_bytes",
        "Bytes that wait for the servers.",
        (),
        [((), waiting.n_bytes)],
    )
    yield gauge(
        "stream_waiting_share",
        "How far the memory for them is filled, 0 to 1; beyond it devices wait.",
        (),
        [((), waiting.n_bytes / waiting.capacity)],
    )
    yield gauge(
        "stream_behind_seconds",
        "For how long something has been waiting without anything being confirmed.",
        (),
        [((), waiting.behind_s)],
    )
