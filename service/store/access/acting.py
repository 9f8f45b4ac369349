"""Through what, and from where, something is being done: known at the rim, written in the store."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace

from service.store.access.audit_entry import Source


@dataclass(frozen=True)
class Acting:
    """Who is at work.

    Parameters
    ----------
    peer
        Address of a request, or the user of the operating system.
    actor
        Who that is, once it is known; empty until then.
    command
        Which command in the database is being carried out; None where none is.
    """

    source: Source = Source.PADWATCH
    peer: str | None = None
    actor: str = ""
    command: str | None = None


NOBODY = Acting()

_ACTING: ContextVar[Acting] = ContextVar("acting", default=NOBODY)


def acting() -> Acting:
    """Who is at work in this task or thread; padwatch itself where nobody has said so."""
    return _ACTING.get()


@contextmanager
def acting_as(who: Acting) -> Iterator[None]:
    """Write down what is done within as done by somebody."""
    token = _ACTING.set(who)
    try:
        yield
    finally:
        _ACTING.reset(token)


def name_actor(actor: str) -> None:
    """Say who is behind the request that is being answered, once that has been checked."""
    _ACTING.set(replace(acting(), actor=actor))
