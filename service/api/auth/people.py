"""Creation and change of accounts and API keys."""

from collections.abc import Sequence

from core.units import DAY_NS
from service.api.auth.passwords import Hashing, new_password
from service.store.access.identities import (
    MAX_DAYS,
    ApiKey,
    Role,
    account_name,
    digest,
    is_token,
    new_key,
    new_token,
)
from service.store.access.tables import AccessRefusedError, AccessStore

NS_PER_S = 1_000_000_000
SET_UP_S = 3600.0
"""Validity period of the set-up token, s."""


class AccountService:
    """Service that creates and changes accounts; its methods block.

    Parameters
    ----------
    store
        Database of accounts, sessions and keys.
    """

    def __init__(self, store: AccessStore, hashing: Hashing) -> None:
        self._store, self._hashing = store, hashing

    def add(
        self, name: str, role: Role, password: str, now_ns: int, must_change: bool = False
    ) -> str:
        """Add an account; return the normalised login name.

        Parameters
        ----------
        must_change
            Whether the password must be changed at the first login.

        Raises
        ------
        NameRefusedError, PasswordRefusedError
            If the name or password is rejected.
        AccessRefusedError
            If the name is taken.
        """
        name = account_name(name)
        hashed = self._hashing.hash(new_password(password, name))
        self._store.accounts.add(name, role, hashed, now_ns, must_change)
        return name

    def set_password(
        self, name: str, password: str, now_ns: int, must_change: bool = False
    ) -> None:
        """Change the password of an account, and end all sessions of the account.

        Parameters
        ----------
        must_change
            Whether the password must be changed at the next login.

        Raises
        ------
        PasswordRefusedError
            If the password is rejected.
        AccessRefusedError
            If the account does not exist.
        """
        hashed = self._hashing.hash(new_password(password, name))
        self._store.accounts.set_password(name, hashed, now_ns, must_change)

    def offer_set_up(self, now_ns: int) -> str | None:
        """Return a new token for creating the first account; None if an account exists.

        Earlier tokens become invalid.
        """
        token = new_token()
        expires_ns = now_ns + round(SET_UP_S * NS_PER_S)
        return token if self._store.set_up.offer(digest(token), expires_ns) else None

    def set_up(self, token: str, name: str, password: str, now_ns: int) -> bool:
        """Create the first account, an administrator; return False if the token is invalid.

        Raises
        ------
        NameRefusedError, PasswordRefusedError
            If the name or password is rejected; the token then remains valid.
        """
        name = account_name(name)
        password = new_password(password, name)
        if not is_token(token) or not self._store.set_up.holds(digest(token), now_ns):
            return False  # checked before hashing, which is slow
        hashed = self._hashing.hash(password)
        return self._store.set_up.take(digest(token), name, hashed, now_ns)


def create_key(
    store: AccessStore, name: str, role: Role, units: Sequence[str], days: int, now_ns: int
) -> tuple[ApiKey, str]:
    """Create an API key; return the stored record and the complete key, which is not stored.

    Parameters
    ----------
    units
        Units for which the key is valid; empty for all units.
    days
        Validity period, days.

    Raises
    ------
    NameRefusedError
        If the name is rejected.
    AccessRefusedError
        If the validity period is out of range, or an admin key is limited to units.
    """
    if not 1 <= days <= MAX_DAYS:
        raise AccessRefusedError(f"validity of a key must be 1 to {MAX_DAYS} days, got {days}")
    if role is Role.ADMIN and units:
        raise AccessRefusedError("a key limited to units must not have the role admin")
    id_, shown = new_key()
    open_units = tuple(dict.fromkeys(units))
    expires_ns = now_ns + days * DAY_NS
    key = ApiKey(id_, account_name(name), digest(shown), role, open_units, now_ns, expires_ns)
    store.keys.add(key)
    return key, shown
