"""The doors: a login by password, and who is behind a session's token or a machine's key."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum

from service.api.auth.backoff import Backoff
from service.api.auth.passwords import Hashing
from service.store.access.identities import (
    Identity,
    KeyState,
    Means,
    NameRefusedError,
    Session,
    SessionLimits,
    account_name,
    digest,
    is_token,
    is_token_of,
    key_id,
    new_token,
)
from service.store.access.port import AccessStore, Account


def at_once(note: Callable[[], None]) -> None:
    """Do it."""
    note()


class Refusal(StrEnum):
    """Why nobody was let in; for the audit, not for whoever asks."""

    UNKNOWN = "unknown"
    EXPIRED = "expired"
    REVOKED = "revoked"


@dataclass(frozen=True)
class LoggedIn:
    """A login that was let in.

    Parameters
    ----------
    token
        For the holder alone; it is stored nowhere.
    """

    token: str = field(repr=False)
    identity: Identity


@dataclass(frozen=True)
class NotLoggedIn:
    """A login that was not let in: a wrong name, a wrong password or a wait, and not which.

    Parameters
    ----------
    wait_s
        How long nothing is tried; 0 if the password was looked at.
    """

    wait_s: float = 0.0


class Doors:
    """Lets people and machines in. Blocks while a password is hashed: call it from a thread.

    Parameters
    ----------
    store
        Accounts, sessions and keys.
    note
        Does what only notes that somebody came; at once unless given. Nobody waits for that, and
        who may come in may do so also while it cannot be written.
    """

    def __init__(
        self,
        store: AccessStore,
        hashing: Hashing,
        backoff: Backoff,
        limits: SessionLimits | None = None,
        note: Callable[[Callable[[], None]], None] = at_once,
    ) -> None:
        self._store, self._hashing, self._backoff = store, hashing, backoff
        self._limits, self._note = limits or SessionLimits(), note
        hashing.prepare()

    def log_in(
        self, name: str, password: str, peer: str, now_ns: int, ticks_ns: int
    ) -> LoggedIn | NotLoggedIn:
        """Begin a session for whoever knows the password of an account.

        Parameters
        ----------
        peer
            Address that it comes from.
        now_ns
            By the host's clock.
        ticks_ns
            By a clock that never goes back.
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
        """End a session; one that is over already is fine."""
        if is_token(token):
            self._store.sessions.end(digest(token))

    def person(self, token: str, now_ns: int) -> Identity | Refusal:
        """Who is behind a session's token now."""
        found = self._store.sessions.get(digest(token)) if is_token(token) else None
        if found is None:
            return Refusal.UNKNOWN
        session, account = found
        if not self._limits.is_live(session, now_ns):
            self._note(lambda: self._store.sessions.end(session.digest))
            return Refusal.EXPIRED
        if self._limits.is_news(session, now_ns):
            self._note(lambda: self._store.sessions.see(session.digest, now_ns))
        return _person(account)

    def machine(self, key: str, now_ns: int) -> Identity | Refusal:
        """Which machine is behind a key now."""
        id_ = key_id(key)
        stored = None if id_ is None else self._store.keys.get(id_)
        if stored is None or not is_token_of(key, stored.digest):
            return Refusal.UNKNOWN
        state = stored.state(now_ns)
        if state is not KeyState.VALID:
            return Refusal.REVOKED if state is KeyState.REVOKED else Refusal.EXPIRED
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
    """The name that an account would have; a wrong one stays wrong, but short."""
    try:
        return account_name(name)
    except NameRefusedError:
        return "?"


def _person(account: Account) -> Identity:
    return Identity(
        account.name, account.role, Means.SESSION, must_change_password=account.must_change
    )
