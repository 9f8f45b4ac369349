"""How many requests are worked on at once, and for how long."""

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.http.refusals import BUSY, NO_ANSWER
from service.runtime.asker import ASKER, Asker
from service.settings.processes import HttpLimitSettings


class BoundedAnswers:
    """ASGI middleware that refuses one request too many, and gives up on what takes too long.

    Both count until an answer begins: from there on the connection watches the one who reads it.
    """

    def __init__(self, app: ASGIApp, limits: HttpLimitSettings) -> None:
        self._app, self._limits = app, limits
        self._n_running = 0
        self._deadlines: set[asyncio.Timeout] = set()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on if there is room for it."""
        if self._n_running >= self._limits.max_requests:
            await BUSY.send(scope, send)
            return
        asker = Asker()
        before = ASKER.set(asker)
        try:
            is_answered = await self._answered(scope, receive, send)
        finally:
            asker.has_gone = True  # a thread may still be at it
            ASKER.reset(before)
        if not is_answered:
            await NO_ANSWER.send(scope, send)

    def give_up(self) -> None:
        """Let no answer begin any more that has not begun."""
        for deadline in self._deadlines:
            deadline.reschedule(0.0)

    async def _answered(self, scope: Scope, receive: Receive, send: Send) -> bool:
        has_begun = False

        async def watched(message: Message) -> None:
            nonlocal has_begun
            if deadline.expired():
                return  # what is still said on the way out
            if not has_begun:
                has_begun = True
                self._n_running -= 1
                self._deadlines.discard(deadline)
                deadline.reschedule(None)
            await send(message)

        self._n_running += 1
        try:
            async with asyncio.timeout(self._limits.answer_s) as deadline:
                self._deadlines.add(deadline)
                await self._app(scope, receive, watched)
        except TimeoutError:
            if not deadline.expired():
                raise
            return False
        finally:
            self._deadlines.discard(deadline)
            if not has_begun:
                self._n_running -= 1
        return True
