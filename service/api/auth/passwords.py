"""Password rules and argon2id hashes."""

import unicodedata
from functools import cached_property, partial

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError
from argon2.profiles import RFC_9106_LOW_MEMORY

MIN_LENGTH = 12
MAX_LENGTH = 256
MIN_DIFFERENT = 6

MAX_AT_ONCE = 2
"""Maximum number of concurrently computed hashes, which limits the use of memory and cores."""


normal_form = partial(unicodedata.normalize, "NFKC")


class PasswordRefusedError(ValueError):
    """Raised if a new password is rejected; the message gives the reason, not the password."""


def new_password(written: str, name: str) -> str:
    """Check the new password `written` for an account; return it in Unicode normal form NFKC.

    The rules require length, but no classes of characters and no expiry (NIST SP 800-63B, 3.1.1).

    Raises `PasswordRefusedError` if the password is too short or too long, has too few different
    characters, or contains the name of the account.
    """
    password = normal_form(written)
    if not MIN_LENGTH <= len(password) <= MAX_LENGTH:
        raise PasswordRefusedError(
            f"a password must have {MIN_LENGTH} to {MAX_LENGTH} characters, got {len(password)}"
        )
    if len(set(password.casefold())) < MIN_DIFFERENT:
        detail = f"a password must have at least {MIN_DIFFERENT} different characters"
        raise PasswordRefusedError(detail)
    if len(name) > 2 and name in password.casefold():
        raise PasswordRefusedError("a password must not contain the name of the account")
    return password


class Hashing:
    """Password hasher; the threads of `Authenticator` limit the concurrent computations.

    `hasher` is the argon2id hasher for new hashes, by default with the second recommendation of
    RFC 9106, section 4: 3 passes, 64 MiB, 4 lanes. Stored hashes with other parameters are verified
    too.
    """

    def __init__(self, hasher: PasswordHasher | None = None) -> None:
        self._hasher = hasher or PasswordHasher.from_parameters(RFC_9106_LOW_MEMORY)

    def hash(self, password: str) -> str:
        """Return a salted argon2id hash of a password."""
        return self._hasher.hash(_bytes(password))

    def verify(self, stored: str | None, password: str) -> bool:
        """Whether a password matches a stored hash.

        Without a hash, the answer is False after the same computing time. A password above the
        maximum length never matches.
        """
        # normalise before truncation: one character may have several encodings
        tried = _bytes(normal_form(password)[: MAX_LENGTH + 1])
        unused = self._unused_hash  # computed once, whether the account is known or not
        try:
            self._hasher.verify(unused if stored is None else stored, tried)
        except (VerificationError, InvalidHashError):
            return False
        return stored is not None

    @cached_property
    def _unused_hash(self) -> str:
        return self._hasher.hash("no account has this password")

    def is_outdated(self, stored: str) -> bool:
        """Whether the hash `stored` was computed with parameters other than the current ones."""
        return self._hasher.check_needs_rehash(stored)


def _bytes(password: str) -> bytes:
    """Return the bytes of a password for hashing, also with lone surrogates, as JSON allows."""
    return normal_form(password).encode("utf-8", "surrogatepass")
