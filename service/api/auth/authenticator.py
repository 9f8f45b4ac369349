"""Authentication: identification of callers by session cookie or API key."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from starlette.datastructures import Headers
from starlette.types import Scope

from acquisition.clock import Clock
from core.units import ns_from_s
from service.api.auth.passwords import AccessThreads, Hashing
from service.api.auth.refusals import Refusals
from service.api.auth.service import AccessService, LoggedIn, NotLoggedIn, tidy_name
from service.settings.processes import is_loopback
from service.store.access.identities import LOCAL, Identity, Means, Role, SessionLimits, digest
from service.store.access.tables import AccessStore

COOKIE = "__Host-padwatch"
"""Name of the session cookie over HTTPS; ``__Host-`` restricts it to one host and to HTTPS."""

PLAIN_COOKIE = "padwatch"
"""Name of the session cookie over HTTP, since some browsers reject secure cookies over HTTP."""

BEARER = "bearer"


@dataclass(frozen=True)
class Credentials:
    """Credentials of a request, not yet checked.

    `means` is session or API key; None without credentials. `secret` is the session token or API
    key; it is empty if ambiguous, as with two cookies.
    """

    means: Means | None = None
    secret: str = field(default="", repr=False)


def credentials_of(scope: Scope) -> Credentials:
    """Return the credentials in the headers of a request; a key takes precedence over a cookie.

    Authorization headers of other schemes than Bearer are for proxies, and are ignored.
    """
    headers = Headers(scope=scope)
    pairs = [value.partition(" ") for value in headers.getlist("authorization")]
    keys = [key.strip() for scheme, _, key in pairs if scheme.lower() == BEARER]
    if keys:
        return Credentials(Means.KEY, keys[0] if len(keys) == 1 else "")
    cookies = _cookies(headers, COOKIE)
    if not cookies and scope["scheme"] == "http":
        cookies = _cookies(headers, PLAIN_COOKIE)
    if not cookies:
        return Credentials()
    return Credentials(Means.SESSION, cookies[0] if len(cookies) == 1 else "")


def _cookies(headers: Headers, wanted: str) -> list[str]:
    values = headers.getlist("cookie")
    pairs = (pair.strip().partition("=") for value in values for pair in value.split(";"))
    return [value for name, _, value in pairs if name.strip() == wanted]


PASSED_ON = (b"forwarded", b"x-forwarded-for", b"x-real-ip", b"via")
"""Names of headers that proxies add; a request with such a header may come from any computer."""


def is_from_here(scope: Scope) -> bool:
    """Whether a request comes directly from this computer, not through a proxy."""
    client = scope.get("client")
    if client is None or not is_loopback(str(client[0])):
        return False
    return not any(name in PASSED_ON for name, _ in scope["headers"])


CALLER = "caller"
"""Key under which the ``state`` of an ASGI scope contains the caller."""


@dataclass(frozen=True)
class Caller:
    """Sender of a request, authenticated or not.

    Parameters
    ----------
    identity
        Identity of the caller; None without valid credentials if a login is required.
    shown
        Credentials in the request, valid or not.
    must_log_in
        Whether requests from the caller's address require a login or key.
    """

    identity: Identity | None
    shown: Credentials = field(repr=False)
    must_log_in: bool


T = TypeVar("T")

CACHE_S = 1.0
"""Time for which an identity is not read again, s: the longest effect of a revoked session or key
that another process has revoked."""

MAX_CACHED = 4096


class Authenticator:
    """Authenticator of callers, with coroutines that run blocking operations in threads.

    `local_role` is the role of callers on this computer without credentials; None if these callers
    must log in. `hashing` is the password hasher, `limits` are the maximum durations of sessions.
    """

    def __init__(
        self,
        store: AccessStore,
        clock: Clock,
        local_role: Role | None = Role.VIEWER,
        hashing: Hashing | None = None,
        limits: SessionLimits | None = None,
    ) -> None:
        self.store, self.clock, self.local_role = store, clock, local_role
        self.service, self.work = AccessService(store, hashing, limits), AccessThreads()
        self.refusals = Refusals(store.audit, clock)
        self._cache: dict[bytes, tuple[float, Identity]] = {}

    async def caller(self, scope: Scope) -> Caller:
        """Return the caller of a request, identified by credentials, else by address.

        An invalid session counts as no credentials; a caller with an invalid key has no identity.

        Raises `StoreError` if the store cannot be read.
        """
        local_role = self.local_role if is_from_here(scope) else None
        shown = credentials_of(scope)
        identity = await self._proven(shown)
        if identity is None and local_role is not None and shown.means is not Means.KEY:
            identity = Identity(LOCAL, local_role, Means.LOCAL)
        return Caller(identity, shown, must_log_in=local_role is None)

    @property
    def now(self) -> tuple[int, int]:
        """Time by the host clock, ns since 1970 UTC, and monotonic time, ns."""
        return self.clock.now_ns(), ns_from_s(self.clock.monotonic_s())

    async def log_in(self, name: str, password: str, peer: str) -> LoggedIn | NotLoggedIn:
        """Check the password of an account, and start a session if it is correct.

        `peer` is the client's address. The result is `NotLoggedIn` after a wrong password, or if
        the attempt came too early.

        Raises `TooManyLoginsError` if there are too many concurrent logins.
        """
        times = self.now
        return await self.work.run_hashing(
            lambda: self.service.log_in(name, password, peer, *times),
            is_known=self.service.backoff.knows(tidy_name(name), peer),
        )

    async def log_out(self, token: str, *, is_replaced: bool = False) -> None:
        """End the session of a token at once; an unknown token is ignored.

        With `is_replaced`, a new login of the same browser ends the session; the audit trail then
        records no logout.
        """
        now_ns = None if is_replaced else self.clock.now_ns()
        await self.change(lambda: self.service.log_out(token, now_ns))

    async def change(self, do: Callable[[], T], *, hashes: bool = False) -> T:
        """Change accounts, sessions or keys in a thread, and clear the cache; return the result.

        The function `do` blocks, and its errors are raised. With `hashes`, it hashes a password.
        Raises `TooManyLoginsError` if the function hashes a password and there are too many
        concurrent logins.
        """
        try:
            return await (self.work.run_hashing(do) if hashes else self.work.run(do))
        finally:
            self._cache = {}

    async def offer_set_up(self) -> str | None:
        """Return a new token for creating the first account; earlier tokens become invalid.

        Return None if an account exists, or if callers on this computer are administrators.
        """
        if self.local_role is Role.ADMIN:
            return None
        now_ns = self.clock.now_ns()
        return await self.work.run(lambda: self.service.offer_set_up(now_ns))

    async def close(self) -> None:
        """Record the number of refused requests without an audit entry; shut down the threads."""
        await self.refusals.close()
        self.work.close()

    async def _proven(self, shown: Credentials) -> Identity | None:
        if not shown.secret:
            return None
        key, cache = digest(shown.secret), self._cache
        until_s, identity = cache.get(key, (0.0, None))
        if self.clock.monotonic_s() < until_s:
            return identity
        check = self.service.machine if shown.means is Means.KEY else self.service.person
        now_ns = self.clock.now_ns()
        identity = await self.work.run(lambda: check(shown.secret, now_ns))
        if identity is not None:
            if len(cache) >= MAX_CACHED:
                cache.clear()
            # a change since the start of the check has replaced the cache
            cache[key] = self.clock.monotonic_s() + CACHE_S, identity
        return identity
