"""Whether anybody still waits for what is worked on, so that nothing is worked on for nobody."""

from contextvars import ContextVar
from dataclasses import dataclass


@dataclass
class Asker:
    """Who waits for an answer; looked at from other threads."""

    has_gone: bool = False


ASKER: ContextVar[Asker | None] = ContextVar("asker", default=None)
"""Of the request that is answered; None where the program works for itself. Threads that are
started with `asyncio.to_thread` see that of their request."""
