"""Who is told of alarms, as it is shown."""

from collections.abc import Sequence
from typing import Protocol

from service.notifications.sender import ReceiverView


class DeliveryLook(Protocol):
    """Who is told of alarms; see :class:`service.notifications.deliveries.Deliveries`."""

    async def look(self) -> Sequence[ReceiverView]:
        """Look at all receivers."""
        ...
