"""What access costs, away from the event loop and from everybody else's threads."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import copy_context
from threading import BoundedSemaphore
from typing import TypeVar

import structlog

from service.api.auth.passwords import MAX_AT_ONCE
from service.store.port import StoreError

log = structlog.get_logger()

MAX_WAITING = 16
"""Passwords that are hashed or wait for it; at a third of a second each nobody waits for long."""

MAX_KNOWN_WAITING = 8
"""And further places for people who have logged in before: strangers cannot take these."""

LOOKUP_THREADS = 2

MAX_NOTES = 64
"""Notes that wait for the disk; more are not taken, they come again."""

T = TypeVar("T")


class TooManyLoginsError(Exception):
    """So many passwords wait to be hashed that no more are taken."""


class AccessWork:
    """Threads for looking into the store, for hashing passwords, and for notes."""

    def __init__(self) -> None:
        self._lookups = ThreadPoolExecutor(LOOKUP_THREADS, "access")
        self._hashes = ThreadPoolExecutor(MAX_AT_ONCE, "passwords")
        self._places = BoundedSemaphore(MAX_WAITING)
        self._known_places = BoundedSemaphore(MAX_KNOWN_WAITING)
        self._notes = ThreadPoolExecutor(1, "notes")
        self._note_places = BoundedSemaphore(MAX_NOTES)

    async def looked_up(self, look: Callable[[], T]) -> T:
        """Do something short that waits for the disk."""
        return await asyncio.wrap_future(self._lookups.submit(copy_context().run, look))

    async def hashed(self, work: Callable[[], T], is_known: bool = True) -> T:
        """Do something that hashes a password.

        Parameters
        ----------
        is_known
            Whether somebody asks who has logged in before.

        Raises
        ------
        TooManyLoginsError
            If too many wait for it already.
        """
        places = self._places
        if not places.acquire(blocking=False):
            places = self._known_places
            if not is_known or not places.acquire(blocking=False):
                raise TooManyLoginsError
        running: Future[T] = self._hashes.submit(copy_context().run, work)
        running.add_done_callback(lambda _: places.release())
        return await asyncio.wrap_future(running)

    def close(self) -> None:
        """Begin nothing more; what has begun is short."""
        for threads in (self._lookups, self._hashes, self._notes):
            threads.shutdown(wait=False, cancel_futures=True)

    def note(self, write: Callable[[], None]) -> None:
        """Write something down that nobody waits for, and that may fail."""
        if self._note_places.acquire(blocking=False):
            running = self._notes.submit(_tried, write)
            running.add_done_callback(lambda _: self._note_places.release())


def _tried(write: Callable[[], None]) -> None:
    try:
        write()
    except StoreError as error:
        log.warning("not noted that somebody came", reason=str(error))
