"""Authentication of callers: logins, sessions, accounts, API keys, and refused requests."""

import asyncio
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import copy_context
from dataclasses import dataclass, field
from math import ceil
from threading import BoundedSemaphore
from typing import TypeVar

import structlog
from starlette.types import Scope

from acquisition.clock import Clock
from core.units import DAY_NS, NS_PER_S, ns_from_s
from service.api.auth.backoff import Backoff, TokenBucket
from service.api.auth.credentials import Caller, credentials_of, is_from_here
from service.api.auth.passwords import MAX_AT_ONCE, Hashing, new_password
from service.api.problems import ProblemError, not_logged_in
from service.store.access.audit_entries import AuditAction, acting
from service.store.access.identities import (
    LOCAL,
    MAX_DAYS,
    ApiKey,
    Identity,
    KeyState,
    Means,
    NameRefusedError,
    Role,
    Session,
    SessionLimits,
    account_name,
    digest,
    is_token,
    is_token_of,
    key_id,
    new_key,
    new_token,
)
from service.store.access.tables import AccessRefusedError, AccessStore, Account
from service.store.port import StoreError

log = structlog.get_logger()

SET_UP_S = 3600.0
"""Validity period of the set-up token, s."""

CACHE_S = 1.0
"""Time for which an identity is not read again, s: the longest effect of a revoked session or key
that another process has revoked."""

MAX_CACHED = 4096

MAX_WAITING = 16
"""Maximum number of running and queued hash computations; each takes about 0.3 s."""

MAX_KNOWN_WAITING = 8
"""Number of further queue places for accounts that have logged in from the same address."""

LOOKUP_THREADS = 2

WRONG = "the name or the password is wrong"

REQUEST_REFUSED = "request.refused"

N_AT_ONCE = 20
"""Burst limit: maximum number of refusals in quick succession that are recorded."""

SECONDS_EACH = 30.0
"""Time after which one more refusal may be recorded, s: at most 2,880 a day."""

T = TypeVar("T")


@dataclass(frozen=True)
class LoggedIn:
    """Result of a successful login.

    `token` is the token of the session, for the cookie; only the digest of the token is stored.
    """

    token: str = field(repr=False)
    identity: Identity


class Authenticator:
    """Authenticator of callers, and service for their accounts, sessions and API keys.

    Coroutines run blocking operations in threads; the other methods block while the store is used.
    Failed logins raise `ProblemError`, the same for a wrong name and a wrong password (401), or
    with the wait if the attempt came too early (429).

    Parameters
    ----------
    local_role
        Role of callers on this computer without credentials; None if these callers must log in.
    hashing
        Password hasher, by default argon2id with the current parameters.
    limits
        Maximum durations of sessions.
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
        self.backoff, self._cache = Backoff(), dict[bytes, tuple[float, Identity]]()
        self._hashing, self._limits = hashing or Hashing(), limits or SessionLimits()
        self._lookups = ThreadPoolExecutor(LOOKUP_THREADS, "access")
        self._hashes = ThreadPoolExecutor(MAX_AT_ONCE, "passwords")
        self._places = BoundedSemaphore(MAX_WAITING)
        self._known_places = BoundedSemaphore(MAX_KNOWN_WAITING)
        self._allowance = TokenBucket(N_AT_ONCE, SECONDS_EACH, clock.monotonic_s())
        self._n_more = 0

    async def caller(self, scope: Scope) -> Caller:
        """Return the caller of a request, identified by credentials, else by address.

        An invalid session counts as no credentials; a caller with an invalid key has no identity.

        Raises `StoreError` if the store cannot be read.
        """
        local_role = self.local_role if is_from_here(scope) else None
        means, secret = credentials_of(scope)
        identity = await self._proven(means, secret) if secret else None
        if identity is None and local_role is not None and means is not Means.KEY:
            identity = Identity(LOCAL, local_role, Means.LOCAL)
        return Caller(identity, means, secret, must_log_in=local_role is None)

    async def _proven(self, means: Means | None, secret: str) -> Identity | None:
        key, cache = digest(secret), self._cache
        until_s, identity = cache.get(key, (0.0, None))
        if self.clock.monotonic_s() < until_s:
            return identity
        check = self.machine if means is Means.KEY else self.person
        identity = await self.run(lambda: check(secret))
        if identity is not None:
            if len(cache) >= MAX_CACHED:
                cache.clear()
            # a change since the start of the check has replaced the cache
            cache[key] = self.clock.monotonic_s() + CACHE_S, identity
        return identity

    async def run(self, look: Callable[[], T]) -> T:
        """Run a short database operation in a thread; return its result."""
        return await asyncio.wrap_future(self._lookups.submit(copy_context().run, look))

    async def run_hashing(self, work: Callable[[], T], is_known: bool = True) -> T:
        """Run a function that hashes a password in a thread; return its result.

        If the account has logged in from this address (`is_known`), it has more queue places.
        Raises `ProblemError` with status 503 if the queue is full.
        """
        places = self._places
        if not places.acquire(blocking=False):
            places = self._known_places
            if not is_known or not places.acquire(blocking=False):
                wait = {"Retry-After": "1"}
                detail = "too many concurrent logins; try again"
                raise ProblemError(503, "Busy", detail, headers=wait)
        running: Future[T] = self._hashes.submit(copy_context().run, work)
        running.add_done_callback(lambda _: places.release())
        return await asyncio.wrap_future(running)

    async def change(self, do: Callable[[], T], *, hashes: bool = False) -> T:
        """Change accounts, sessions or keys in a thread, and clear the cache; return the result.

        The function `do` blocks, and its errors are raised. With `hashes`, it hashes a password.
        """
        try:
            return await (self.run_hashing(do) if hashes else self.run(do))
        finally:
            self._cache = {}

    async def close(self) -> None:
        """Record the number of refused requests without an entry, if any; shut down the threads.

        Running work is not awaited, and queued work is cancelled.
        """
        if self._n_more:
            now_ns, after = self.clock.now_ns(), {"n_refused_more": self._n_more}
            await self._record(AuditAction(now_ns, "padwatch", REQUEST_REFUSED, "", after=after))
        for threads in (self._lookups, self._hashes):
            threads.shutdown(wait=False, cancel_futures=True)

    async def record_refusal(self, operation: str, reason: str, status: int) -> None:
        """Record a refused request; above the rate limit, count it for the next entry.

        If the entry cannot be stored, the error is logged and the request is counted. `operation`
        is method and path of the request; `reason` and `status` are the reason and the HTTP status
        in the answer.
        """
        if not self._allowance.take(self.clock.monotonic_s()):
            self._n_more += 1
            return
        n_before, self._n_more = self._n_more, 0
        after = {"status": status} | ({"n_refused_more": n_before} if n_before else {})
        now_ns, who = self.clock.now_ns(), acting()
        what = (now_ns, who.actor, REQUEST_REFUSED, operation, None, after, reason)
        if not await self._record(AuditAction(*what, who.source, who.peer)):
            self._n_more += n_before + 1

    async def _record(self, entry: AuditAction) -> bool:
        try:
            await asyncio.to_thread(self.store.audit.record, [entry])
        except StoreError as error:
            words = "a refused request cannot be audited; the next entry will count it"
            log.error(words, reason=str(error))
            return False
        return True

    def log_in(self, name: str, password: str, peer: str) -> LoggedIn:
        """Check the password of an account, and start a session.

        `peer` is the network address of the client, for the backoff after failed logins.
        """
        account = self._checked(name, password, peer)
        if self._hashing.is_outdated(account.password_hash):
            self.store.accounts.rehash(account, self._hashing.hash(password))
        return self._begun(account, peer)

    def change_password(self, name: str, password: str, new: str, peer: str) -> LoggedIn:
        """Change a person's own password, end all sessions of the account, and start a new one.

        Nothing changes if the current password is wrong or the attempt comes too early. `peer` is
        the network address of the client.

        Raises `PasswordRefusedError` if the new password is rejected.
        """
        account = self._checked(name, password, peer)
        self.set_password(account.name, new)
        return self._begun(self.store.accounts.get(account.name), peer)

    async def log_out(self, token: str, *, is_replaced: bool = False) -> None:
        """End the session of a token at once; an unknown token is ignored.

        With `is_replaced`, a new login of the same browser ends the session; the audit trail then
        records no logout.
        """
        logout_ns = None if is_replaced else self.clock.now_ns()
        if is_token(token):
            await self.change(lambda: self.store.sessions.end(digest(token), logout_ns))

    def person(self, token: str) -> Identity | None:
        """Return the identity of a person by session token; None if it is unknown or expired.

        The time of use is stored, and an expired session is deleted.
        """
        found = self.store.sessions.get(digest(token)) if is_token(token) else None
        if found is None:
            return None
        (session, account), now_ns = found, self.clock.now_ns()
        is_live = self._limits.is_live(session, now_ns)
        with _tried():
            if not is_live:
                self.store.sessions.end(session.digest)
            elif self._limits.is_news(session, now_ns):
                self.store.sessions.see(session.digest, now_ns)
        return _person(account) if is_live else None

    def machine(self, key: str) -> Identity | None:
        """Return the identity of a machine by API key, and store the time of use.

        Return None if the key is unknown, expired or revoked.
        """
        id_, now_ns = key_id(key), self.clock.now_ns()
        stored = None if id_ is None else self.store.keys.get(id_)
        if stored is None or not is_token_of(key, stored.digest):
            return None
        if stored.state(now_ns) is not KeyState.VALID:
            return None
        with _tried():
            if stored.is_news(now_ns):
                self.store.keys.see(stored.id, now_ns)
        return Identity(stored.name, stored.role, Means.KEY, stored.units)

    def add(self, name: str, role: Role, password: str, must_change: bool = False) -> str:
        """Add an account; return the normalised login name.

        With `must_change`, the password must be changed at the first login.

        Raises `NameRefusedError` or `PasswordRefusedError` if the name or password is rejected, and
        `AccessRefusedError` if the name is taken.
        """
        name = account_name(name)
        hashed = self._hashing.hash(new_password(password, name))
        self.store.accounts.add(name, role, hashed, self.clock.now_ns(), must_change)
        return name

    def set_password(self, name: str, password: str, must_change: bool = False) -> None:
        """Change the password of an account, and end all sessions of the account.

        With `must_change`, the password must be changed at the next login.

        Raises `PasswordRefusedError` if the password is rejected, and `AccessRefusedError` if the
        account does not exist.
        """
        hashed = self._hashing.hash(new_password(password, name))
        self.store.accounts.set_password(name, hashed, self.clock.now_ns(), must_change)

    def offer_set_up(self) -> str | None:
        """Return a new token for creating the first account; earlier tokens become invalid.

        Return None if an account exists, or if callers on this computer are administrators.
        """
        token, expires_ns = new_token(), self.clock.now_ns() + round(SET_UP_S * NS_PER_S)
        if self.local_role is Role.ADMIN or not self.store.set_up.offer(digest(token), expires_ns):
            return None
        return token

    def set_up(self, token: str, name: str, password: str) -> bool:
        """Create the first account, an administrator; return whether the token was valid.

        Raises `NameRefusedError` or `PasswordRefusedError` if the name or password is rejected; the
        token then remains valid.
        """
        name, now_ns = account_name(name), self.clock.now_ns()
        password = new_password(password, name)
        if not is_token(token) or not self.store.set_up.holds(digest(token), now_ns):
            return False  # checked before hashing, which is slow
        hashed = self._hashing.hash(password)
        return self.store.set_up.take(digest(token), name, hashed, now_ns)

    def create_key(
        self, name: str, role: Role, units: Sequence[str], days: int
    ) -> tuple[ApiKey, str]:
        """Create an API key; return the stored record and the complete key, which is not stored.

        `units` are the units for which the key is valid, empty for all units; `days` is the
        validity period of the key from now, days.

        Raises `NameRefusedError` if the name is rejected, and `AccessRefusedError` if the validity
        period is out of range, or an admin key is limited to units.
        """
        if not 1 <= days <= MAX_DAYS:
            raise AccessRefusedError(f"a key is valid for 1 to {MAX_DAYS} days, not for {days}")
        if role is Role.ADMIN and units:
            raise AccessRefusedError("a key for some units cannot have the role admin")
        (id_, shown), now_ns = new_key(), self.clock.now_ns()
        open_units, expires_ns = tuple(dict.fromkeys(units)), now_ns + days * DAY_NS
        key = ApiKey(id_, account_name(name), digest(shown), role, open_units, now_ns, expires_ns)
        self.store.keys.add(key)
        return key, shown

    def _checked(self, name: str, password: str, peer: str) -> Account:
        name = tidy_name(name)
        if wait_s := self.backoff.attempt(name, peer, ns_from_s(self.clock.monotonic_s())):
            wait = {"Retry-After": str(max(1, ceil(wait_s)))}
            detail = f"too many failed logins; try again after {wait['Retry-After']} s"
            raise ProblemError(429, "Wait", detail, headers=wait)
        account = self.store.accounts.get(name)
        is_right = self._hashing.verify(account.password_hash if account else None, password)
        if account is None or not is_right:
            raise not_logged_in(WRONG)
        return account

    def _begun(self, account: Account | None, peer: str) -> LoggedIn:
        token, now_ns = new_token(), self.clock.now_ns()
        if account is not None:
            session = Session(digest(token), account.name, now_ns, now_ns)
            oldest_ns = self._limits.oldest_ns(now_ns)
            if self.store.sessions.add(session, account.password_number, oldest_ns):
                self.backoff.succeeded(account.name, peer)
                return LoggedIn(token, _person(account))
        raise not_logged_in(WRONG)  # the account was removed or its password changed meanwhile


@contextmanager
def _tried() -> Iterator[None]:
    """Log an error of the store; a session or key stays valid if its use cannot be stored."""
    try:
        yield
    except StoreError as error:
        log.warning("the last use of a session or key cannot be stored", reason=str(error))


def tidy_name(name: str) -> str:
    """Return a login name in normalised form; "?" for an invalid name."""
    try:
        return account_name(name)
    except NameRefusedError:
        return "?"


def _person(account: Account) -> Identity:
    return Identity(
        account.name, account.role, Means.SESSION, must_change_password=account.must_change
    )
