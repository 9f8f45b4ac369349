"""Notification receivers and Prometheus metrics of a replica, a process that only serves HTTP."""

import asyncio
import platform
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version

from prometheus_client.metrics_core import Metric
from prometheus_client.process_collector import ProcessCollector

from acquisition.clock import Clock
from core.quality import Level
from service.cluster.replica_state import ReplicaAlarms, ReplicaFilms, ReplicaLive
from service.live.live_view import LinkState
from service.measuring.metrics import alarm_metrics, film_metrics, one, store_info
from service.notifications.metrics import delivery_metrics
from service.notifications.sender import (
    Receiver,
    ReceiverView,
    SenderState,
    SenderStatus,
    receiver_views,
)
from service.runtime.metrics import gauge
from service.store.outbox import Outbox
from service.store.port import StoreError

UNIT = ("unit",)


class NoCaptures:
    """Capture state of a replica, which makes no captures."""

    error: str | None = None
    trouble: str | None = None
    n_running = 0
    n_written = 0
    being_made: frozenset[tuple[str, int]] = frozenset()


class ReplicaDeliveries:
    """State of the notification receivers in a replica, which reads the outbox without sending."""

    def __init__(self, receivers: Sequence[Receiver], outbox: Outbox) -> None:
        self._receivers, self._outbox = {each.name: each for each in receivers}, outbox

    async def look(self) -> list[ReceiverView]:
        """Return the state of all receivers. Raises `StoreError` if the outbox cannot be read."""
        return await asyncio.to_thread(receiver_views, self._receivers, self._outbox, self._status)

    def _status(self, name: str) -> SenderStatus:
        """Return the sender status of a receiver, from its oldest waiting message."""
        for first in self._outbox.waiting(name, 1):
            if not first.n_attempts:
                return SenderStatus(SenderState.SENDING)
            n_attempts, since_ns = first.n_attempts, first.queued_ns
            return SenderStatus(SenderState.RETRYING, n_attempts, since_ns, first.answer)
        return SenderStatus()


@dataclass(frozen=True)
class ReplicaMetrics:
    """Collector of the Prometheus metrics of a replica."""

    bearings: Mapping[str, Sequence[str]]
    live: ReplicaLive
    alarms: ReplicaAlarms
    films: ReplicaFilms
    deliveries: ReplicaDeliveries
    clock: Clock
    store_kind: str
    receivers: Sequence[ReceiverView] | None = None

    async def scrape(self) -> "ReplicaMetrics":
        """Return a copy with the receiver states; `self` if the outbox cannot be read."""
        try:
            return replace(self, receivers=await self.deliveries.look())
        except StoreError:
            return self

    def collect(self) -> Iterator[Metric]:
        """Yield all metrics of the replica."""
        yield gauge(
            "build_info",
            "Versions of padwatch and Python; always 1.",
            ("version", "python"),
            [((version("padwatch"), platform.python_version()), 1)],
        )
        yield store_info(self.store_kind)
        yield from unit_metrics(self.live, list(self.bearings))
        levels = Counter(
            (unit, self.live.current(unit, bearing).quality.level)
            for unit, bearings in self.bearings.items()
            for bearing in bearings
        )
        yield gauge(
            "bearings",
            "Bearings by the quality of their newest result; bad without a current result.",
            ("unit", "quality"),
            (((u, lev.name.lower()), levels[u, lev]) for u in self.bearings for lev in Level),
        )
        yield from alarm_metrics(self.alarms, self.bearings)
        yield from film_metrics(self.films.newest, self.bearings)
        yield from delivery_metrics(self.receivers, self.clock.now_ns())
        yield from ProcessCollector(registry=None).collect()


def unit_metrics(live: ReplicaLive, units: Sequence[str]) -> Iterator[Metric]:
    """Yield the metrics of link state, report age and data age of each unit."""
    connected = (((u,), live.status(u).state is LinkState.CONNECTED) for u in units)
    yield gauge("link_connected", "1 while the device is connected.", UNIT, connected)
    alive = (((u,), live.is_alive(u)) for u in units)
    yield gauge("unit_analysed", "1 while a process reports the state of the unit.", UNIT, alive)
    silence = (((u,), s) for u in units if (s := live.silence_s(u)) is not None)
    meaning = "Time since the last report of the process that analyses the unit."
    yield gauge("unit_silence_seconds", meaning, UNIT, silence)
    ages = (((u,), age) for u in units if (age := live.data_age_s(u)) is not None)
    yield gauge("data_age_seconds", "Time since the newest samples arrived.", UNIT, ages)
    yield one("reports_readable", "1 if the database could be read.", live.read_error is None)
