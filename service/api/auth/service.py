"""Rules of access: logins, sessions, accounts and API keys."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import structlog

from core.units import DAY_NS, NS_PER_S
from service.api.auth.backoff import Backoff
from service.api.auth.passwords import Hashing, new_password
from service.store.access.identities import (
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


@dataclass(frozen=True)
class LoggedIn:
    """Result of a successful login.

    `token` is the token of the session, for the cookie; only the digest of the token is stored.
    """

    token: str = field(repr=False)
    identity: Identity


@dataclass(frozen=True)
class NotLoggedIn:
    """Result of a failed login, the same for a wrong name and a wrong password.

    `wait_s` is the time until the next attempt is allowed, s, if this attempt came too early;
    otherwise 0.
    """

    wait_s: float = 0.0


class AccessService:
    """Service for logins, accounts and API keys; its methods block while the store is used.

    `hashing` is the password hasher, by default argon2id with the current parameters; `limits` are
    the maximum durations of sessions.
    """

    def __init__(
        self,
        store: AccessStore,
        hashing: Hashing | None = None,
        limits: SessionLimits | None = None,
    ) -> None:
        self.store, self.backoff = store, Backoff()
        self._hashing, self._limits = hashing or Hashing(), limits or SessionLimits()

    def log_in(
        self, name: str, password: str, peer: str, now_ns: int, ticks_ns: int
    ) -> LoggedIn | NotLoggedIn:
        """Check the password of an account, and start a session if it is correct.

        Parameters
        ----------
        name, password
            Login name and password of the account.
        peer
            Network address of the client, for the backoff after failed logins.
        now_ns
            Time by the host clock, ns since 1970 UTC.
        ticks_ns
            Monotonic time, ns.
        """
        account = self._checked(name, password, peer, ticks_ns)
        if isinstance(account, NotLoggedIn):
            return account
        if self._hashing.is_outdated(account.password_hash):
            self.store.accounts.rehash(account, self._hashing.hash(password))
        return self._begun(account, peer, now_ns)

    def log_out(self, token: str, now_ns: int | None = None) -> None:
        """End the session of a token; an unknown token is ignored.

        `now_ns` is the time of the logout for the audit trail, ns since 1970 UTC; None records no
        logout.
        """
        if is_token(token):
            self.store.sessions.end(digest(token), now_ns)

    def change_password(
        self, name: str, password: str, new: str, peer: str, now_ns: int, ticks_ns: int
    ) -> LoggedIn | NotLoggedIn:
        """Change a person's own password, end all sessions of the account, and start a new one.

        Nothing changes if the current password is wrong or the attempt comes too early.

        Raises `PasswordRefusedError` if the new password is rejected.

        Parameters
        ----------
        name
            Login name of the account.
        password, new
            Current and new password.
        peer, now_ns, ticks_ns
            Address of the client, host time (ns since 1970 UTC), and monotonic time (ns).
        """
        account = self._checked(name, password, peer, ticks_ns)
        if isinstance(account, NotLoggedIn):
            return account
        self.set_password(account.name, new, now_ns)
        changed = self.store.accounts.get(account.name)
        return NotLoggedIn() if changed is None else self._begun(changed, peer, now_ns)

    def person(self, token: str, now_ns: int) -> Identity | None:
        """Return the identity of a person by session token; None if it is unknown or expired.

        The time of use is stored, and an expired session is deleted.
        """
        found = self.store.sessions.get(digest(token)) if is_token(token) else None
        if found is None:
            return None
        session, account = found
        is_live = self._limits.is_live(session, now_ns)
        with _tried():
            if not is_live:
                self.store.sessions.end(session.digest)
            elif self._limits.is_news(session, now_ns):
                self.store.sessions.see(session.digest, now_ns)
        return _person(account) if is_live else None

    def machine(self, key: str, now_ns: int) -> Identity | None:
        """Return the identity of a machine by API key, and store the time of use.

        Return None if the key is unknown, expired or revoked.
        """
        id_ = key_id(key)
        stored = None if id_ is None else self.store.keys.get(id_)
        if stored is None or not is_token_of(key, stored.digest):
            return None
        if stored.state(now_ns) is not KeyState.VALID:
            return None
        with _tried():
            if stored.is_news(now_ns):
                self.store.keys.see(stored.id, now_ns)
        return Identity(stored.name, stored.role, Means.KEY, stored.units)

    def add(
        self, name: str, role: Role, password: str, now_ns: int, must_change: bool = False
    ) -> str:
        """Add an account; return the normalised login name.

        With `must_change`, the password must be changed at the first login. `now_ns` is the host
        time, ns since 1970 UTC.

        Raises
        ------
        NameRefusedError, PasswordRefusedError
            If the name or password is rejected.
        AccessRefusedError
            If the name is taken.
        """
        name = account_name(name)
        hashed = self._hashing.hash(new_password(password, name))
        self.store.accounts.add(name, role, hashed, now_ns, must_change)
        return name

    def set_password(
        self, name: str, password: str, now_ns: int, must_change: bool = False
    ) -> None:
        """Change the password of an account, and end all sessions of the account.

        With `must_change`, the password must be changed at the next login. `now_ns` is the host
        time, ns since 1970 UTC.

        Raises
        ------
        PasswordRefusedError
            If the password is rejected.
        AccessRefusedError
            If the account does not exist.
        """
        hashed = self._hashing.hash(new_password(password, name))
        self.store.accounts.set_password(name, hashed, now_ns, must_change)

    def offer_set_up(self, now_ns: int) -> str | None:
        """Return a new token for creating the first account; None if an account exists.

        Earlier tokens become invalid. `now_ns` is the host time, ns since 1970 UTC.
        """
        token = new_token()
        expires_ns = now_ns + round(SET_UP_S * NS_PER_S)
        return token if self.store.set_up.offer(digest(token), expires_ns) else None

    def set_up(self, token: str, name: str, password: str, now_ns: int) -> bool:
        """Create the first account, an administrator; return whether the token was valid.

        Raises `NameRefusedError` or `PasswordRefusedError` if the name or password is rejected; the
        token then remains valid. `now_ns` is the host time, ns since 1970 UTC.
        """
        name = account_name(name)
        password = new_password(password, name)
        if not is_token(token) or not self.store.set_up.holds(digest(token), now_ns):
            return False  # checked before hashing, which is slow
        hashed = self._hashing.hash(password)
        return self.store.set_up.take(digest(token), name, hashed, now_ns)

    def create_key(
        self, name: str, role: Role, units: Sequence[str], days: int, now_ns: int
    ) -> tuple[ApiKey, str]:
        """Create an API key; return the stored record and the complete key, which is not stored.

        `units` are the units for which the key is valid, empty for all units; `days` is the
        validity period of the key, days, from the host time `now_ns`, ns since 1970 UTC.

        Raises
        ------
        NameRefusedError
            If the name is rejected.
        AccessRefusedError
            If the validity period is out of range, or an admin key is limited to units.
        """
        if not 1 <= days <= MAX_DAYS:
            raise AccessRefusedError(f"a key is valid for 1 to {MAX_DAYS} days, not for {days}")
        if role is Role.ADMIN and units:
            raise AccessRefusedError("a key for some units cannot have the role admin")
        id_, shown = new_key()
        open_units = tuple(dict.fromkeys(units))
        expires_ns = now_ns + days * DAY_NS
        key = ApiKey(id_, account_name(name), digest(shown), role, open_units, now_ns, expires_ns)
        self.store.keys.add(key)
        return key, shown

    def _checked(self, name: str, password: str, peer: str, ticks_ns: int) -> Account | NotLoggedIn:
        name = tidy_name(name)
        if wait_s := self.backoff.attempt(name, peer, ticks_ns):
            return NotLoggedIn(wait_s)
        account = self.store.accounts.get(name)
        is_right = self._hashing.verify(account.password_hash if account else None, password)
        return account if account is not None and is_right else NotLoggedIn()

    def _begun(self, account: Account, peer: str, now_ns: int) -> LoggedIn | NotLoggedIn:
        token = new_token()
        session = Session(digest(token), account.name, now_ns, now_ns)
        oldest_ns = self._limits.oldest_ns(now_ns)
        if not self.store.sessions.add(session, account.password_number, oldest_ns):
            return NotLoggedIn()  # the password was changed meanwhile
        self.backoff.succeeded(account.name, peer)
        return LoggedIn(token, _person(account))


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
