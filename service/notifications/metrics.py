"""Metrics of the delivery of notifications, by receiver of the plant file."""

from collections.abc import Sequence

from core.units import NS_PER_S
from service.live.receivers import ReceiverView, SenderState
from service.runtime.metrics import Families

DELIVERY = {
    "outbox_readable": "This is 1 if the outbox could be read.",
    "delivery_waiting_messages": "This is the number of messages that wait for the receiver.",
    "delivery_dead_messages": "This is the number of messages that the receiver rejected or that"
    " expired.",
    "delivery_failed_attempts": "This is the number of failed attempts since the last delivery.",
    "delivery_wait_seconds": "This is the waiting time of the oldest message for the receiver.",
}


def add_deliveries(families: Families, views: Sequence[ReceiverView] | None, now_ns: int) -> None:
    """Add the delivery metrics of all receivers; ``views`` is None if the outbox is unreadable.

    The recipients of one mail have one label, the id of the mail; labels contain no address.
    """
    families.declare(DELIVERY)
    families.add("outbox_readable", views is not None)
    by_name: dict[str, list[ReceiverView]] = {}
    for view in views or ():
        if view.state is not SenderState.REMOVED:
            by_name.setdefault(view.id.partition(":")[0], []).append(view)
    for name, its in by_name.items():
        since_ns = [view.waiting_since_ns for view in its if view.waiting_since_ns is not None]
        for measure, value in (
            ("waiting_messages", sum(view.n_waiting for view in its)),
            ("dead_messages", sum(view.n_dead for view in its)),
            ("failed_attempts", sum(view.n_failures for view in its)),
            ("wait_seconds", max(0, now_ns - min(since_ns, default=now_ns)) / NS_PER_S),
        ):
            families.add(f"delivery_{measure}", value, receiver=name)
