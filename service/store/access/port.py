"""Accounts, sessions and keys as the rest of the service sees them.

Each method that changes something is on the disk when it returns, with what the audit trail tells.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from service.store.access.identities import ApiKey, Role, Session


class AccessRefusedError(Exception):
    """A change of accounts or keys that is not made; the message says why."""


@dataclass(frozen=True)
class Account:
    """Somebody who may log in.

    Parameters
    ----------
    password_hash
        Argon2id in its usual text form, which holds its parameters.
    password_number
        Counts the account's passwords; a login belongs to the password that it was made with.
    password_ns
        When the password was set.
    must_change
        Whether somebody else has set it, so that it opens nothing but the change of it.
    """

    name: str
    role: Role
    password_hash: str = field(repr=False)
    password_number: int
    created_ns: int
    password_ns: int
    must_change: bool = False


class AccountStore(Protocol):
    """People."""

    def add(
        self, name: str, role: Role, password_hash: str, now_ns: int, must_change: bool = False
    ) -> None:
        """Add an account. Raises `AccessRefusedError` if there is one of that name."""
        ...

    def get(self, name: str) -> Account | None:
        """Read an account; None if there is none of that name."""
        ...

    def all(self) -> Sequence[Account]:
        """Read every account, by name."""
        ...

    def set_role(self, name: str, role: Role, now_ns: int) -> None:
        """Change a role. Raises `AccessRefusedError` if no admin would be left, or none such."""
        ...

    def set_password(
        self, name: str, password_hash: str, now_ns: int, must_change: bool = False
    ) -> None:
        """Change a password and end all sessions. Raises `AccessRefusedError` if none such."""
        ...

    def rehash(self, account: Account, password_hash: str) -> None:
        """Write the same password's new hash, unless the password has changed meanwhile."""
        ...

    def remove(self, name: str, now_ns: int) -> None:
        """Remove an account with its sessions.

        Raises `AccessRefusedError` if there are others and no admin would be left, or none such.
        """
        ...


class SessionStore(Protocol):
    """Logins."""

    def add(self, session: Session, password_number: int, oldest_ns: int) -> bool:
        """Begin a session, unless the password it was given for is no longer the account's.

        Sessions begun before `oldest_ns` are forgotten, and the account's oldest beyond a number.
        """
        ...

    def get(self, digest: bytes) -> tuple[Session, Account] | None:
        """Read a session with its account as it is now."""
        ...

    def see(self, digest: bytes, now_ns: int) -> None:
        """Note that a session was used."""
        ...

    def end(self, digest: bytes) -> None:
        """End a session; ending it twice is fine."""
        ...

    def end_all(self) -> None:
        """End the sessions of all accounts."""
        ...


class KeyStore(Protocol):
    """Keys of machines."""

    def add(self, key: ApiKey) -> None:
        """Add a key."""
        ...

    def get(self, id_: str) -> ApiKey | None:
        """Read a key; None if there is none with that id."""
        ...

    def all(self) -> Sequence[ApiKey]:
        """Read every key that ever was, oldest first."""
        ...

    def see(self, id_: str, now_ns: int) -> None:
        """Note that a key was used."""
        ...

    def revoke(self, id_: str, now_ns: int) -> bool:
        """Take a key back for ever; whether it was not taken back before."""
        ...


class SetUpStore(Protocol):
    """The token with which the first account is made."""

    def offer(self, digest: bytes, expires_ns: int) -> bool:
        """Put a token in the place of any before it; not if there is an account."""
        ...

    def holds(self, digest: bytes, now_ns: int) -> bool:
        """Whether a token could be taken now."""
        ...

    def take(self, digest: bytes, name: str, password_hash: str, now_ns: int) -> bool:
        """Make the first account, an admin, and use the token up.

        Whether that was done: not with another or an expired token, nor if there is an account.
        """
        ...


class AccessStore(Protocol):
    """All that is stored about who may come in."""

    @property
    def accounts(self) -> AccountStore:
        """People."""
        ...

    @property
    def sessions(self) -> SessionStore:
        """Logins."""
        ...

    @property
    def keys(self) -> KeyStore:
        """Keys of machines."""
        ...

    @property
    def set_up(self) -> SetUpStore:
        """The token with which the first account is made."""
        ...
