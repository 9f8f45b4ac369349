"""`Scrape`: all metrics as they are at one moment, in the format that is asked for."""

import platform
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version

from prometheus_client import exposition
from prometheus_client.metrics_core import Metric
from prometheus_client.openmetrics import exposition as open_exposition
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector

from service.api.load.metrics import load_metrics
from service.app.watched import Watched
from service.measuring.metrics.acquired import link_metrics, sample_metrics
from service.measuring.metrics.judged import alarm_metrics, film_metrics, result_metrics
from service.measuring.metrics.kept import (
    evidence_metrics,
    queue_metrics,
    soundness_metrics,
    space_metrics,
    store_metrics,
)
from service.notifications.deliveries import ReceiverView
from service.notifications.metrics import delivery_metrics
from service.recordings.metrics import recording_metrics
from service.runtime.families import gauge
from service.store.port import StoreError

TEXT = exposition.CONTENT_TYPE_PLAIN_0_0_4
OPEN_METRICS = "application/openmetrics-text; version=1.0.0; charset=utf-8"


@dataclass(frozen=True)
class Scrape:
    """What is read on the event loop without waiting, so that all numbers belong together.

    Parameters
    ----------
    receivers
        What waits for whom; None if that could not be read.
    """

    watched: Watched
    receivers: Sequence[ReceiverView] | None

    def collect(self) -> Iterator[Metric]:
        """All families."""
        watched = self.watched
        yield gauge(
            "build_info",
            "1; which padwatch this is, and by which Python it runs.",
            ("version", "python"),
            [((version("padwatch"), platform.python_version()), 1)],
        )
        for metrics in (
            *(sample_metrics, link_metrics, queue_metrics, result_metrics),
            *(store_metrics, space_metrics, evidence_metrics, load_metrics),
            recording_metrics,
        ):
            yield from metrics(watched)
        yield from soundness_metrics(watched.soundness)
        yield from alarm_metrics(watched.alarms, watched.bearings)
        yield from film_metrics(watched.films.newest, watched.bearings)
        yield from delivery_metrics(self.receivers, watched.clock.now_ns())
        yield from ProcessCollector(registry=None).collect()


async def scrape(watched: Watched) -> Scrape:
    """Look at the parts of the service; an outbox that cannot be read is a metric, no error."""
    try:
        return Scrape(watched, await watched.deliveries.look())
    except StoreError:
        return Scrape(watched, None)


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
