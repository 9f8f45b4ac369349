"""Who is told of alarms, and what waits for them."""

from fastapi import APIRouter, Response

from service.api.auth.declared import Reach, needs
from service.api.context import Context
from service.api.delivery_models import DeadLetterModel, DeliveryModel, ReceiverModel
from service.api.problems import problem_responses
from service.api.rendering import rendered_now
from service.notifications.sender import ReceiverView, SenderStatus
from service.runtime.times import rfc3339
from service.store.access.identities import Permission
from service.store.outbox import Backlog, LetterState, StoredLetter

NO_BACKLOG = Backlog("", 0, None, 0, None, None)


def delivery_router(context: Context) -> APIRouter:
    """Routes about delivery; they change nothing."""
    router = APIRouter(
        prefix="/api/v1", tags=["alarms"], dependencies=[needs(Permission.READ, Reach.NO_UNIT)]
    )

    @router.get(
        "/delivery",
        summary="Who is told of alarms",
        response_model=DeliveryModel,
        responses=problem_responses(503),
    )
    async def delivery() -> Response:
        """All receivers of webhooks and mail: backlog, failures, what was never delivered."""
        receivers = [_receiver(view) for view in await context.deliveries.look()]
        return await rendered_now(lambda: _delivery(context, receivers))

    return router


def _delivery(context: Context, receivers: list[ReceiverModel]) -> DeliveryModel:
    return DeliveryModel(
        origin=context.origin.value,
        time=rfc3339(context.clock.now_ns()),
        n_waiting=sum(receiver.n_waiting for receiver in receivers),
        n_failing=sum(receiver.is_failing for receiver in receivers),
        receivers=receivers,
    )


def _receiver(view: ReceiverView) -> ReceiverModel:
    receiver, backlog = view.receiver, view.backlog or NO_BACKLOG
    status = view.status or SenderStatus()
    return ReceiverModel(
        id=view.name,
        kind=receiver.kind if receiver else None,
        address=receiver.address if receiver else None,
        state=status.state.value if view.status else "not_in_the_plant_file",
        is_failing=status.n_failures > 0,
        n_failures=status.n_failures,
        failing_since=_time(status.failing_since_ns),
        reason=status.reason,
        next_attempt=_time(status.next_attempt_ns),
        n_waiting=backlog.n_waiting,
        waiting_since=_time(backlog.oldest_ns),
        n_dead=backlog.n_dead,
        last_dead=_dead(backlog.last_dead),
        last_delivered=_time(backlog.delivered_ns),
    )


def _dead(letter: StoredLetter | None) -> DeadLetterModel | None:
    if letter is None or letter.done_ns is None:
        return None
    return DeadLetterModel(
        event_id=letter.event_id,
        outcome="refused" if letter.state is LetterState.REFUSED else "expired",
        reason=letter.answer,
        time=rfc3339(letter.done_ns),
    )


def _time(time_ns: int | None) -> str | None:
    return None if time_ns is None else rfc3339(time_ns)
