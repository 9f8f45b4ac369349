"""Route for the receivers of alarm messages, with the state of their deliveries."""

from fastapi import APIRouter

from service.api.auth.gate import Reach, subject_router
from service.api.context import Context
from service.api.values import ApiModel
from service.live.receivers import ReceiverView
from service.settings.storage import Origin


class DeliveryModel(ApiModel):
    """State of all receivers of alarm messages; a replay sends no messages."""

    origin: Origin

    receivers: list[ReceiverView]
    """Receivers in the order of the plant file, then receivers that are no longer in it."""


def delivery_router(context: Context) -> APIRouter:
    """Return the router for the delivery of alarm messages."""
    router = subject_router("", "alarms", reach=Reach.NO_UNIT)

    @router.get("/delivery")
    async def message_receivers() -> DeliveryModel:
        """List the receivers of alarm messages with their waiting and failed messages."""
        return DeliveryModel.of(context, receivers=await context.receivers())

    return router
