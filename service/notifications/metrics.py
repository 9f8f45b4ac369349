"""Metrics of deliveries: what waits for whom, by receiver as the plant file names it."""

from collections.abc import Iterator, Mapping, Sequence

from prometheus_client.metrics_core import Metric

from core.units import NS_PER_S
from service.notifications.sender import ReceiverView
from service.runtime.metrics import gauge

RECEIVER = ("receiver",)


def delivery_metrics(views: Sequence[ReceiverView] | None, now_ns: int) -> Iterator[Metric]:
    """What waits for receivers; of None it is known only that it cannot be read."""
    by_name = _by_name(views or ())
    yield gauge("outbox_readable", "1 if what waits could be read.", (), [((), views is not None)])
    for name, meaning, of in (
        ("delivery_waiting_messages", "Messages that wait for a receiver.", _n_waiting),
        ("delivery_dead_messages", "Messages refused by a receiver, or given up.", _n_dead),
        (
            "delivery_failed_attempts",
            "Attempts in vain since the last message that a receiver took.",
            _n_failures,
        ),
    ):
        yield gauge(
            name, meaning, RECEIVER, (((key,), sum(map(of, its))) for key, its in by_name.items())
        )
    yield gauge(
        "delivery_wait_seconds",
        "For how long the oldest message for a receiver has waited.",
        RECEIVER,
        (
            ((key,), max((_wait_s(view, now_ns) for view in its), default=0.0))
            for key, its in by_name.items()
        ),
    )


def _by_name(views: Sequence[ReceiverView]) -> Mapping[str, list[ReceiverView]]:
    """Receivers of the plant file; a mail's recipients together: addresses are no labels."""
    found: dict[str, list[ReceiverView]] = {}
    for view in views:
        if view.receiver is not None:
            found.setdefault(view.name.partition(":")[0], []).append(view)
    return found


def _n_waiting(view: ReceiverView) -> int:
    return view.backlog.n_waiting if view.backlog else 0


def _n_dead(view: ReceiverView) -> int:
    return view.backlog.n_dead if view.backlog else 0


def _n_failures(view: ReceiverView) -> int:
    return view.status.n_failures if view.status else 0


def _wait_s(view: ReceiverView, now_ns: int) -> float:
    oldest_ns = view.backlog.oldest_ns if view.backlog else None
    return 0.0 if oldest_ns is None else max(0.0, (now_ns - oldest_ns) / NS_PER_S)
