"""Authentication: logins, and identification of callers by session cookie or API key."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum, auto
from functools import cached_property

from starlette.types import Scope

from acquisition.clock import Clock
from core.units import ns_from_s
from service.api.auth.backoff import Backoff
from service.api.auth.passwords import AccessThreads, Hashing
from service.api.auth.people import AccountService
from service.settings.processes import is_loopback
from service.store.access.identities import (
    LOCAL,
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
    new_token,
)
from service.store.access.tables import AccessStore, Account


def immediately(note: Callable[[], None]) -> None:
    """Call a function at once; default for the parameter `note` of `CredentialChecker`."""
    note()


@dataclass(frozen=True)
class LoggedIn:
    """Result of a successful login.

    Parameters
    ----------
    token
        Token of the session, for the cookie; only the digest of the token is stored.
    identity
        Identity of the person who logged in.
    """

    token: str = field(repr=False)
    identity: Identity


@dataclass(frozen=True)
class NotLoggedIn:
    """Result of a failed login, the same for a wrong name and a wrong password.

    Parameters
    ----------
    wait_s
        Time until the next attempt is allowed, s, if this attempt came too early; otherwise 0.
    """

    wait_s: float = 0.0


class CredentialChecker:
    """Checker of passwords, session tokens and API keys; its methods block.

    Parameters
    ----------
    store
        Database of accounts, sessions and keys.
    limits
        Maximum durations of sessions; default values if None.
    note
        Function that calls its argument, a write of minor importance, at once or later.
    """

    def __init__(
        self,
        store: AccessStore,
        hashing: Hashing,
        backoff: Backoff,
        limits: SessionLimits | None = None,
        note: Callable[[Callable[[], None]], None] = immediately,
    ) -> None:
        self._store, self._hashing, self._backoff = store, hashing, backoff
        self._limits, self._note = limits or SessionLimits(), note
        hashing.prepare()

    def log_in(
        self, name: str, password: str, peer: str, now_ns: int, ticks_ns: int
    ) -> LoggedIn | NotLoggedIn:
        """Check the password of an account; start a session if it is correct.

        Parameters
        ----------
        peer
            Network address of the client.
        now_ns
            Time by the host clock, ns since 1970 UTC.
        ticks_ns
            Monotonic time, ns.
        """
        name = tidy_name(name)
        if wait_s := self._backoff.attempt(name, peer, ticks_ns):
            return NotLoggedIn(wait_s)
        account = self._store.accounts.get(name)
        if not self._hashing.verify(account.password_hash if account else None, password):
            return NotLoggedIn()
        if account is None or (token := self._begin(account, now_ns)) is None:
            return NotLoggedIn()
        self._backoff.succeeded(name, peer)
        self._renew_hash(account, password)
        return LoggedIn(token, _person(account))

    def log_out(self, token: str) -> None:
        """End the session of a token; an unknown token is ignored."""
        if is_token(token):
            self._store.sessions.end(digest(token))

    def person(self, token: str, now_ns: int) -> Identity | None:
        """Return the identity of a person by session token; None if it is unknown or expired."""
        found = self._store.sessions.get(digest(token)) if is_token(token) else None
        if found is None:
            return None
        session, account = found
        if not self._limits.is_live(session, now_ns):
            self._note(lambda: self._store.sessions.end(session.digest))
            return None
        if self._limits.is_news(session, now_ns):
            self._note(lambda: self._store.sessions.see(session.digest, now_ns))
        return _person(account)

    def machine(self, key: str, now_ns: int) -> Identity | None:
        """Return the identity of a machine by API key; None if unknown, expired or revoked."""
        id_ = key_id(key)
        stored = None if id_ is None else self._store.keys.get(id_)
        if stored is None or not is_token_of(key, stored.digest):
            return None
        if stored.state(now_ns) is not KeyState.VALID:
            return None
        if stored.is_news(now_ns):
            self._note(lambda: self._store.keys.see(stored.id, now_ns))
        return Identity(stored.name, stored.role, Means.KEY, stored.units)

    def _begin(self, account: Account, now_ns: int) -> str | None:
        token = new_token()
        session = Session(digest(token), account.name, now_ns, now_ns)
        oldest_ns = self._limits.oldest_ns(now_ns)
        begun = self._store.sessions.add(session, account.password_number, oldest_ns)
        return token if begun else None

    def _renew_hash(self, account: Account, password: str) -> None:
        if self._hashing.is_outdated(account.password_hash):
            self._store.accounts.rehash(account, self._hashing.hash(password))


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


COOKIE = "__Host-padwatch"
"""Name of the session cookie over HTTPS; ``__Host-`` restricts it to one host and to HTTPS."""

PLAIN_COOKIE = "padwatch"
"""Name of the session cookie over HTTP, since some browsers reject secure cookies over HTTP."""

BEARER = "bearer"

Headers = Iterable[tuple[bytes, bytes]]


class Kind(Enum):
    """Kind of the credentials in a request."""

    NOTHING = auto()
    SESSION = auto()
    KEY = auto()

    WRONG = auto()
    """Ambiguous credentials, such as two cookies."""


@dataclass(frozen=True)
class Credentials:
    """Credentials of a request: session token or API key, not yet checked.

    Parameters
    ----------
    secret
        Session token or API key; empty for other kinds.
    """

    kind: Kind
    secret: str = field(default="", repr=False)


NOTHING, WRONG = Credentials(Kind.NOTHING), Credentials(Kind.WRONG)


def credentials_of(headers: Headers, scheme: str) -> Credentials:
    """Return the credentials in the headers of a request; a key takes precedence over a cookie."""
    found = list(headers)
    keys = list(_keys(value.decode("latin-1") for name, value in found if name == b"authorization"))
    if len(keys) > 1:
        return WRONG
    if keys:
        return Credentials(Kind.KEY, keys[0])
    values = [value.decode("latin-1") for name, value in found if name == b"cookie"]
    cookies = _cookies(values, COOKIE)
    if not cookies and scheme == "http":
        cookies = _cookies(values, PLAIN_COOKIE)
    if len(cookies) > 1:
        return WRONG
    return Credentials(Kind.SESSION, cookies[0]) if cookies else NOTHING


def _keys(values: Iterable[str]) -> Iterator[str]:
    """Yield the bearer tokens in Authorization headers; other schemes, for proxies, are ignored."""
    for value in values:
        scheme, _, key = value.partition(" ")
        if scheme.lower() == BEARER:
            yield key.strip()


def _cookies(values: Iterable[str], wanted: str) -> list[str]:
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


class Authenticator:
    """Authenticator of callers, with coroutines that run blocking operations in threads.

    Parameters
    ----------
    store
        Database of accounts, sessions and keys.
    local_role
        Role of callers on this computer without credentials; None if these callers must log in.
    hashing
        Password hasher; default: argon2id with the current parameters.
    limits
        Maximum durations of sessions; default values if None.
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
        self._hashing, self._limits, self._backoff = hashing or Hashing(), limits, Backoff()
        self.people, self.work = AccountService(store, self._hashing), AccessThreads()

    async def caller(self, scope: Scope) -> Caller:
        """Return the caller of a request, identified by credentials or address.

        Raises
        ------
        StoreError
            If the store cannot be read.
        """
        local_role = self.local_role if is_from_here(scope) else None
        shown = credentials_of(scope["headers"], scope["scheme"])
        identity = await self._proven(shown)
        # a wrong key is refused; an expired session counts as no credentials
        is_anonymous = identity is None and shown.kind in (Kind.NOTHING, Kind.SESSION)
        if is_anonymous and local_role is not None:
            identity = Identity(LOCAL, local_role, Means.LOCAL)
        return Caller(identity, shown, must_log_in=local_role is None)

    async def log_in(self, name: str, password: str, peer: str) -> LoggedIn | NotLoggedIn:
        """Check the password of an account; start a session if it is correct.

        Raises
        ------
        TooManyLoginsError
            If there are too many concurrent logins.
        """
        now_ns, ticks_ns = self.clock.now_ns(), ns_from_s(self.clock.monotonic_s())
        return await self.work.run_hashing(
            lambda: self._checker.log_in(name, password, peer, now_ns, ticks_ns),
            is_known=self._backoff.knows(tidy_name(name), peer),
        )

    async def log_out(self, token: str) -> None:
        """End the session of a token; an unknown token is ignored."""
        await self.work.run(lambda: self._checker.log_out(token))

    async def set_up(self, token: str, name: str, password: str) -> bool:
        """Create the first account, an administrator; return False if the token is invalid.

        Raises
        ------
        NameRefusedError, PasswordRefusedError, TooManyLoginsError
            If the name or password is rejected, or there are too many concurrent logins.
        """
        now_ns = self.clock.now_ns()
        return await self.work.run_hashing(
            lambda: self.people.set_up(token, name, password, now_ns), is_known=False
        )

    async def offer_set_up(self) -> str | None:
        """Return a token for creating the first account; None if no account needs to be created."""
        if self.local_role is Role.ADMIN:
            return None
        now_ns = self.clock.now_ns()
        return await self.work.run(lambda: self.people.offer_set_up(now_ns))

    async def has_accounts(self) -> bool:
        """Whether any account exists."""
        return bool(await self.work.run(self.store.accounts.all))

    def close(self) -> None:
        """Shut down the threads; no request can be authenticated afterwards."""
        self.work.close()

    async def _proven(self, shown: Credentials) -> Identity | None:
        now_ns = self.clock.now_ns()
        if shown.kind is Kind.SESSION:
            return await self.work.run(lambda: self._checker.person(shown.secret, now_ns))
        if shown.kind is Kind.KEY:
            return await self.work.run(lambda: self._checker.machine(shown.secret, now_ns))
        return None

    @cached_property
    def _checker(self) -> CredentialChecker:
        return CredentialChecker(
            self.store, self._hashing, self._backoff, self._limits, self.work.note
        )
