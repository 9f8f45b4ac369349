"""Passwords: what is accepted, and how it is kept (argon2id)."""

import unicodedata
from functools import cached_property
from threading import BoundedSemaphore

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

MIN_LENGTH = 12
MAX_LENGTH = 256
MIN_DIFFERENT = 6

TIME_COST = 3
MEMORY_KIB = 65_536
PARALLELISM = 4
"""The second recommendation of RFC 9106, section 4: three passes over 64 MiB in four lanes."""

MAX_AT_ONCE = 2
"""Hashes at the same time, so that logins cannot take the host's memory or all its cores."""

NOBODYS = "no account has this password"


class PasswordRefusedError(ValueError):
    """A password that is not accepted; the message says why, never what it was."""


def plant_hasher() -> PasswordHasher:
    """Argon2id with the parameters that are in force."""
    return PasswordHasher(time_cost=TIME_COST, memory_cost=MEMORY_KIB, parallelism=PARALLELISM)


def new_password(written: str, name: str) -> str:
    """Check a new password of an account.

    Length counts; there are no rules of composition and none of age (NIST SP 800-63B, 3.1.1).

    Raises
    ------
    PasswordRefusedError
        If it is too short, too long, too even, or holds the account's name.
    """
    password = _normal(written)
    if not MIN_LENGTH <= len(password) <= MAX_LENGTH:
        raise PasswordRefusedError(
            f"a password has {MIN_LENGTH} to {MAX_LENGTH} characters, this one has {len(password)}"
        )
    if len(set(password.casefold())) < MIN_DIFFERENT:
        raise PasswordRefusedError(f"a password has at least {MIN_DIFFERENT} different characters")
    if len(name) > 2 and name in password.casefold():
        raise PasswordRefusedError("a password does not hold the name of its account")
    return password


class Hashing:
    """Makes and checks hashes of passwords, a few at once.

    Parameters
    ----------
    hasher
        Argon2id with the parameters in force; hashes with others are still verified.
    """

    def __init__(self, hasher: PasswordHasher | None = None) -> None:
        self._hasher = hasher or plant_hasher()
        self._places = BoundedSemaphore(MAX_AT_ONCE)

    def prepare(self) -> None:
        """Make the first refusal as slow as all others, and no slower."""
        _ = self._nobodys_hash

    def hash(self, password: str) -> str:
        """Hash a password for storing; salted, so never twice the same."""
        with self._places:
            return self._hasher.hash(_bytes(password))

    def verify(self, stored: str | None, password: str) -> bool:
        """Whether a password is the stored one; without a stored one just as slow, and no.

        An overlong password is hashed up to its limit and is wrong.
        """
        # of one form first: a character may be written as several
        tried = _bytes(_normal(password)[: MAX_LENGTH + 1])
        with self._places:
            try:
                self._hasher.verify(self._nobodys_hash if stored is None else stored, tried)
            except (VerificationError, InvalidHashError):
                return False
        return stored is not None

    @cached_property
    def _nobodys_hash(self) -> str:
        return self._hasher.hash(NOBODYS)

    def is_outdated(self, stored: str) -> bool:
        """Whether a hash was made with other parameters than those in force."""
        return self._hasher.check_needs_rehash(stored)


def _normal(password: str) -> str:
    """One form for what keyboards write in several."""
    return unicodedata.normalize("NFKC", password)


def _bytes(password: str) -> bytes:
    """What is hashed; also of text that is no text, which JSON can carry."""
    return _normal(password).encode("utf-8", "surrogatepass")
