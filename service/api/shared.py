"""An answer about now that is put together once for all who ask at about the same time."""

import asyncio
from collections.abc import Callable
from contextvars import Context, copy_context

from fastapi import Response

from acquisition.clock import Clock
from service.api.rendering import Dated, rendered_now
from service.runtime.asker import ASKER

FRESH_S = 1.0
"""How old an answer may be in what no revision tells, such as what ends by time alone."""


class SharedAnswer:
    """The newest answer of one route; who asks while it is being made waits for it, too.

    Parameters
    ----------
    make
        Puts it together, in a thread; may block.
    revision
        Another number as soon as there is anything in it that must be shown at once.
    """

    def __init__(
        self, make: Callable[[], Dated], revision: Callable[[], int], clock: Clock
    ) -> None:
        self._make, self._revision, self._clock = make, revision, clock
        self._made: tuple[int, float, asyncio.Task[Response]] | None = None

    async def answer(self) -> Response:
        """The answer now, for one client."""
        revision, now_s = self._revision(), self._clock.monotonic_s()
        if self._made is None or self._made[0] != revision or now_s - self._made[1] >= FRESH_S:
            making = asyncio.create_task(rendered_now(self._make), context=_for_all())
            self._made = (revision, now_s, making)
        # whoever goes away takes the answer from nobody else
        shared = await asyncio.shield(self._made[2])
        return Response(shared.body, media_type=shared.media_type, headers=dict(_tag(shared)))


def _for_all() -> Context:
    """Context without the client that asked first: what it reads goes on if that one leaves."""
    context = copy_context()
    context.run(ASKER.set, None)
    return context


def _tag(response: Response) -> list[tuple[str, str]]:
    return [("ETag", response.headers["etag"])]
