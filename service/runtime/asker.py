"""Connection state of the client of the current request, as a context variable."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Lock, Thread


class Asker:
    """Connection state of the client of a request, for the threads that work on the request."""

    def __init__(self) -> None:
        self.has_gone = False
        self._lock = Lock()
        self._cancels: list[Callable[[], None]] = []

    def leave(self) -> None:
        """Mark the client as disconnected; cancel its running statements from a new thread."""
        with self._lock:
            self.has_gone = True
            cancels = tuple(self._cancels)
        if cancels:
            Thread(target=lambda: [cancel() for cancel in cancels], name="padwatch-cancel").start()

    @contextmanager
    def cancelling(self, cancel: Callable[[], None]) -> Iterator[None]:
        """Return a context manager during which a disconnection of the client calls `cancel`.

        `cancel` may still run after the end of the context if `has_gone` is then true.
        """
        with self._lock:
            self._cancels.append(cancel)
        try:
            yield
        finally:
            with self._lock:
                self._cancels.remove(cancel)


ASKER: ContextVar[Asker | None] = ContextVar("asker", default=None)
"""Client of the current request; None outside requests. Threads started with `asyncio.to_thread`
inherit the value of their request."""
