"""Whose name stands beside an action."""

from fastapi import Request

from service.api.auth.gate import identity_of
from service.store.access.audit_entries import acting, name_actor
from service.store.access.identities import LOCAL


def actor_or(given: str | None) -> str:
    """The name of who has shown who he is; else the one that was given, or where he sits."""
    return acting().actor or given or LOCAL


async def name_whoever_asks(request: Request) -> None:
    """Let what is done by a request be told with a name also where nobody has to log in.

    Not in a thread, as plain functions are: what is said there is not heard here.
    """
    name_actor(identity_of(request).actor)
