"""`Scrape`: all metrics as they are at one moment, in the format that is asked for."""

import platform
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version

from prometheus_client.metrics_core import Metric
from prometheus_client.process_collector import ProcessCollector

from service.api.load import load_metrics
from service.app.watched import Watched
from service.measuring.metrics.acquired import link_metrics, sample_metrics
from service.measuring.metrics.judged import alarm_metrics, film_metrics, result_metrics
from service.measuring.metrics.kept import (
    one,
    queue_metrics,
    soundness_metrics,
    space_metrics,
    store_metrics,
)
from service.notifications.deliveries import ReceiverView
from service.notifications.metrics import delivery_metrics
from service.recordings.capture.captures import Captures
from service.recordings.metrics import recording_metrics
from service.reports.keeper import EvidenceKeeper
from service.runtime.families import counter, gauge
from service.store.port import StoreError


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
        live, units = watched.live, watched.bearings
        yield from sample_metrics(live, units)
        yield from link_metrics(live, list(units), watched.sources, watched.clock.now_ns())
        yield from queue_metrics(watched.bus)
        yield from result_metrics(watched.timings, live, units)
        yield from store_metrics(watched.recorder, live, watched.timings, watched.store_kind)
        yield from space_metrics(watched.space)
        yield from evidence_metrics(watched.captures, watched.evidence)
        yield from load_metrics(watched.load)
        yield from recording_metrics(watched.tape, watched.recordings)
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


def evidence_metrics(captures: Captures, evidence: EvidenceKeeper) -> Iterator[Metric]:
    """Samples and evidence around alarms."""
    counts = (
        ("captures_written", "Captures of samples around alarms.", captures.n_written),
        ("captures_failed", "Attempts to write such captures in vain.", captures.n_failed),
        ("evidence_written", "Bundles of evidence of alarms.", evidence.n_written),
        ("evidence_failed", "Attempts to write such bundles in vain.", evidence.n_failed),
        ("evidence_lost", "Occurrences whose evidence was given up.", evidence.n_lost),
    )
    for name, meaning, number in counts:
        yield counter(name, meaning, (), [((), number)])
    yield one("captures_running", "Captures that are being made.", captures.n_running)
    yield one("evidence_pending", "Bundles that are still to be written.", evidence.n_pending)
