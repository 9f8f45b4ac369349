"""Whether a request comes from this computer itself."""

from starlette.types import Scope

from service.settings.processes import is_loopback

PASSED_ON = (b"forwarded", b"x-forwarded-for", b"x-real-ip", b"via")
"""Headers of a proxy: what it passes on may come from anywhere."""


def is_from_here(scope: Scope) -> bool:
    """Whether a program or browser on this computer asks, and no proxy for somebody else."""
    client = scope.get("client")
    if client is None or not is_loopback(str(client[0])):
        return False
    return not any(name in PASSED_ON for name, _ in scope["headers"])
