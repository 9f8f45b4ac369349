"""Prometheus metrics of notification delivery, by receiver of the plant file."""

from collections.abc import Callable, Iterator, Sequence

from prometheus_client.metrics_core import Metric

from core.units import NS_PER_S
from service.notifications.sender import ReceiverView
from service.runtime.metrics import gauge


def delivery_metrics(views: Sequence[ReceiverView] | None, now_ns: int) -> Iterator[Metric]:
    """Yield the metrics of all receivers; ``views`` is None if the outbox cannot be read."""
    by_name: dict[str, list[ReceiverView]] = {}
    for view in views or ():
        if (
            view.receiver is not None
        ):  # one label for all recipients of a mail; labels contain no address
            by_name.setdefault(view.name.partition(":")[0], []).append(view)

    def family(name: str, meaning: str, value: Callable[[list[ReceiverView]], float]) -> Metric:
        rows = (((key,), value(its)) for key, its in by_name.items())
        return gauge(f"delivery_{name}", meaning, ("receiver",), rows)

    def wait_s(view: ReceiverView) -> float:
        oldest_ns = view.backlog.oldest_ns if view.backlog else None
        return 0.0 if oldest_ns is None else max(0.0, (now_ns - oldest_ns) / NS_PER_S)

    yield gauge("outbox_readable", "1 if the outbox could be read.", (), [((), views is not None)])
    yield family(
        "waiting_messages",
        "Messages that wait for delivery to a receiver.",
        lambda its: sum(view.backlog.n_waiting for view in its if view.backlog),
    )
    yield family(
        "dead_messages",
        "Messages that a receiver rejected or that expired.",
        lambda its: sum(view.backlog.n_dead for view in its if view.backlog),
    )
    yield family(
        "failed_attempts",
        "Failed attempts since the last delivery.",
        lambda its: sum(view.status.n_failures for view in its if view.status),
    )
    yield family(
        "wait_seconds",
        "Waiting time of the oldest message for a receiver.",
        lambda its: max(map(wait_s, its)),
    )
