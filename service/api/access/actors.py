"""Whose name stands beside an action."""

from service.audit.acting import acting
from service.security.identity import LOCAL


def actor_or(given: str | None) -> str:
    """The name of who has shown who he is; else the one that was given, or where he sits."""
    return acting().actor or given or LOCAL.name
