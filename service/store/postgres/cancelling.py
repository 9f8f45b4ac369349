"""Ending reads for which nobody waits any more."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

import psycopg

from service.runtime.asker import ASKER, Asker
from service.store.port import StoreError
from service.store.postgres.connection import Session

LOOK_EVERY_S = 0.1
CANCEL_WITHIN_S = 2.0


@contextmanager
def cancelled_when_gone(session: Session) -> Iterator[None]:
    """Cancel what a session does as soon as its asker has gone; nothing where nobody asks.

    Raises
    ------
    StoreError
        If the asker has gone.
    """
    asker = ASKER.get()
    if asker is None:
        yield
        return
    is_done = Event()
    watcher = Thread(target=_watch, args=(session, asker, is_done), name="padwatch-asker")
    watcher.start()
    try:
        yield
    finally:
        is_done.set()
        watcher.join()
        if asker.has_gone:
            raise StoreError("interrupted: nobody waits for the answer")


def _watch(session: Session, asker: Asker, is_done: Event) -> None:
    while not asker.has_gone:
        if is_done.wait(LOOK_EVERY_S):
            return
    try:
        session.cancel_safe(timeout=CANCEL_WITHIN_S)
    except psycopg.Error:
        return  # the server is gone, and what it did with it
