"""Metrics of a replica: what it has been told, and how long ago."""

import platform
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version

from prometheus_client.metrics_core import Metric
from prometheus_client.process_collector import ProcessCollector

from acquisition.clock import Clock
from core.quality import Level
from service.cluster.replica.alarms import ReplicaAlarms
from service.cluster.replica.deliveries import ReplicaDeliveries
from service.cluster.replica.films import ReplicaFilms
from service.cluster.replica.live import ReplicaLive
from service.live.live_view import LinkState
from service.measuring.metrics.judged import alarm_metrics, film_metrics
from service.measuring.metrics.kept import store_info
from service.notifications.deliveries import ReceiverView
from service.notifications.metrics import delivery_metrics
from service.runtime.metrics import gauge
from service.store.port import StoreError

UNIT = ("unit",)


@dataclass(frozen=True)
class ReplicaMetrics:
    """What a replica's metrics are read from.

    Parameters
    ----------
    bearings
        Of every unit.
    """

    bearings: Mapping[str, Sequence[str]]
    live: ReplicaLive
    alarms: ReplicaAlarms
    films: ReplicaFilms
    deliveries: ReplicaDeliveries
    clock: Clock
    store_kind: str

    async def scrape(self) -> "ReplicaScrape":
        """Look at all of it; an outbox that cannot be read is a metric, no error."""
        try:
            return ReplicaScrape(self, await self.deliveries.look())
        except StoreError:
            return ReplicaScrape(self, None)


@dataclass(frozen=True)
class ReplicaScrape:
    """All metrics at one moment.

    Parameters
    ----------
    receivers
        What waits for whom; None if that could not be read.
    """

    of: ReplicaMetrics
    receivers: Sequence[ReceiverView] | None

    def collect(self) -> Iterator[Metric]:
        """All families."""
        of = self.of
        which = ((version("padwatch"), platform.python_version()), 1)
        yield gauge(
            "build_info",
            "1; which padwatch this is, and by which Python it runs.",
            ("version", "python"),
            [which],
        )
        yield store_info(of.store_kind)
        yield from unit_metrics(of)
        yield _bearing_metric(of)
        yield from alarm_metrics(of.alarms, of.bearings)
        yield from film_metrics(of.films.newest, of.bearings)
        yield from delivery_metrics(self.receivers, of.clock.now_ns())
        yield from ProcessCollector(registry=None).collect()


def unit_metrics(of: ReplicaMetrics) -> Iterator[Metric]:
    """How each unit is, as far as this replica has been told."""
    live, units = of.live, list(of.bearings)
    connected = (((u,), live.status(u).state is LinkState.CONNECTED) for u in units)
    yield gauge("link_connected", "1 while the device is connected.", UNIT, connected)
    alive = (((u,), live.is_alive(u)) for u in units)
    yield gauge("unit_analysed", "1 while a process says that it analyses the unit.", UNIT, alive)
    silence = (((u,), s) for u in units if (s := live.silence_s(u)) is not None)
    meaning = "Since the last sign of life of whoever analyses the unit."
    yield gauge("unit_silence_seconds", meaning, UNIT, silence)
    ages = (((u,), age) for u in units if (age := live.data_age_s(u)) is not None)
    yield gauge("data_age_seconds", "Since samples arrived last.", UNIT, ages)
    is_readable = [((), live.read_error is None)]
    yield gauge("reports_readable", "1 if the database could be read.", (), is_readable)


def _bearing_metric(of: ReplicaMetrics) -> Metric:
    found = Counter(
        (unit, of.live.current(unit, bearing).quality.level)
        for unit, bearings in of.bearings.items()
        for bearing in bearings
    )
    return gauge(
        "bearings",
        "Bearings by the quality of what is known of them now; bad without a current result.",
        ("unit", "quality"),
        (((u, level.name.lower()), found[u, level]) for u in of.bearings for level in Level),
    )
