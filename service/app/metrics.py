"""Metrics of a process that measures."""

import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version

from prometheus_client.metrics_core import Metric
from prometheus_client.process_collector import ProcessCollector

from acquisition.clock import Clock
from service.api.load import LoadWatch, load_metrics
from service.live.live_view import LiveView
from service.measuring.acquirer import Bus
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.counters import (
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
from service.measuring.films import FilmKeeper
from service.measuring.recorder import Recorder
from service.measuring.soundness import Soundness
from service.measuring.timings import Timings
from service.notifications.metrics import delivery_metrics
from service.notifications.sender import Deliveries, ReceiverView
from service.recordings.around_alarms import Captures
from service.recordings.continuous_recorder import Tape
from service.recordings.keeper import WaveformKeeper
from service.recordings.metrics import recording_metrics
from service.reports.collector import EvidenceCollector
from service.runtime.disk import SpaceWatch
from service.runtime.metrics import counter, gauge
from service.runtime.polls import TimedSource
from service.store.port import StoreError


@dataclass(frozen=True)
class Watched:
    """Parts of the process that metrics are read from.

    Parameters
    ----------
    bearings
        Bearings of every unit.
    sources
        Timed sources by unit.
    space
        Disk watch, if there is one.
    load
        Load monitor, if requests can be refused.
    tape, recordings
        Continuous recorder and keeper of recordings, if there are any.
    soundness
        Check of stored data, if there is one.
    store_kind
        `Store.kind` of the database, if it is reported.
    """

    bearings: Mapping[str, Sequence[str]]
    live: LiveView
    bus: Bus
    recorder: Recorder
    alarms: AlarmEngine
    films: FilmKeeper
    captures: Captures
    evidence: EvidenceCollector
    deliveries: Deliveries
    timings: Timings
    clock: Clock
    sources: Mapping[str, TimedSource] = field(default_factory=dict)
    space: SpaceWatch | None = None
    load: LoadWatch | None = None
    tape: Tape | None = None
    recordings: WaveformKeeper | None = None
    soundness: Soundness | None = None
    store_kind: str | None = None


@dataclass(frozen=True)
class Scrape:
    """Collector that reads all parts at once on the event loop, so that numbers are consistent.

    Parameters
    ----------
    receivers
        Queued messages by receiver; None if the outbox cannot be read.
    """

    watched: Watched
    receivers: Sequence[ReceiverView] | None

    def collect(self) -> Iterator[Metric]:
        """Yield all families."""
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
    """Prepare a scrape; an outbox that cannot be read is reported as a metric."""
    try:
        return Scrape(watched, await watched.deliveries.look())
    except StoreError:
        return Scrape(watched, None)


def evidence_metrics(captures: Captures, evidence: EvidenceCollector) -> Iterator[Metric]:
    """Yield the families of captures and evidence."""
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
