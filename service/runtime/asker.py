"""Connection state of the client of the current request, as a context variable."""

from contextvars import ContextVar
from dataclasses import dataclass


@dataclass
class Asker:
    """Whether the client of a request has disconnected (`has_gone`); other threads read it."""

    has_gone: bool = False


ASKER: ContextVar[Asker | None] = ContextVar("asker", default=None)
"""Client of the current request; None outside requests. Threads started with `asyncio.to_thread`
inherit the value of their request."""
