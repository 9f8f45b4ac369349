"""Prometheus metrics of a process that analyses."""

import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version

from prometheus_client.metrics_core import Metric
from prometheus_client.process_collector import ProcessCollector

from service.api.load import load_metrics
from service.app.measuring_process import Analysis
from service.measuring.acquirer import Bus
from service.measuring.metrics import (
    alarm_metrics,
    film_metrics,
    link_metrics,
    one,
    queue_metrics,
    result_metrics,
    sample_metrics,
    soundness_metrics,
    space_metrics,
    store_metrics,
)
from service.notifications.metrics import delivery_metrics
from service.notifications.sender import ReceiverView
from service.recordings.around_alarms import Captures
from service.recordings.metrics import recording_metrics
from service.reports.collector import EvidenceCollector
from service.runtime.metrics import counter, gauge
from service.runtime.polls import TimedSource
from service.store.port import StoreError


@dataclass(frozen=True)
class Scrape:
    """Prometheus collector that reads all parts at once on the event loop, for consistent numbers.

    Parameters
    ----------
    sources
        Timed sample sources by unit id.
    receivers
        Queue state of each message receiver; None if the outbox cannot be read.
    """

    analysis: Analysis
    bus: Bus
    sources: Mapping[str, TimedSource]
    receivers: Sequence[ReceiverView] | None

    def collect(self) -> Iterator[Metric]:
        """Yield all metric families."""
        parts, process = self.analysis, self.analysis.process
        live, timings, now_ns = process.live, process.timings, process.clock.now_ns()
        units = {unit.id: [bearing.id for bearing in unit.bearing] for unit in process.plant.unit}
        yield gauge(
            "build_info",
            "Versions of padwatch and Python; always 1.",
            ("version", "python"),
            [((version("padwatch"), platform.python_version()), 1)],
        )
        yield from sample_metrics(live, units)
        yield from link_metrics(live, list(units), self.sources, now_ns)
        yield from queue_metrics(self.bus)
        yield from result_metrics(timings, live, units)
        yield from store_metrics(parts.recorder, live, timings, process.store.kind)
        yield from space_metrics(parts.space)
        yield from evidence_metrics(parts.captures, parts.evidence)
        yield from load_metrics(parts.load)
        yield from recording_metrics(parts.tape, parts.recordings)
        yield from soundness_metrics(parts.soundness)
        yield from alarm_metrics(parts.alarms, units)
        yield from film_metrics(parts.films.newest, units)
        yield from delivery_metrics(self.receivers, now_ns)
        yield from ProcessCollector(registry=None).collect()


async def scrape(analysis: Analysis, bus: Bus, sources: Mapping[str, TimedSource]) -> Scrape:
    """Return the collector of one scrape; an unreadable outbox is reported as a metric."""
    try:
        return Scrape(analysis, bus, sources, await analysis.deliveries.look())
    except StoreError:
        return Scrape(analysis, bus, sources, None)


def evidence_metrics(captures: Captures, evidence: EvidenceCollector) -> Iterator[Metric]:
    """Yield the metric families of captures and evidence."""
    counts = (
        ("captures_written", "Captures of samples around alarms.", captures.n_written),
        ("captures_failed", "Failed attempts to write captures.", captures.n_failed),
        ("evidence_written", "Bundles of evidence of alarms.", evidence.n_written),
        ("evidence_failed", "Failed attempts to write evidence bundles.", evidence.n_failed),
        ("evidence_lost", "Occurrences of alarms whose evidence was lost.", evidence.n_lost),
    )
    for name, meaning, number in counts:
        yield counter(name, meaning, (), [((), number)])
    yield one("captures_running", "Captures in progress.", captures.n_running)
    yield one("evidence_pending", "Evidence bundles that wait to be written.", evidence.n_pending)
