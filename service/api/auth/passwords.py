"""Password rules, argon2id hashes, and the thread pools that compute the hashes."""

import asyncio
import unicodedata
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import copy_context
from functools import cached_property
from threading import BoundedSemaphore
from typing import TypeVar

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

MIN_LENGTH = 12
MAX_LENGTH = 256
MIN_DIFFERENT = 6

TIME_COST = 3
MEMORY_KIB = 65_536
PARALLELISM = 4
"""Argon2id parameters, second recommendation of RFC 9106, section 4: 3 passes, 64 MiB, 4 lanes."""

MAX_AT_ONCE = 2
"""Maximum number of concurrently computed hashes, which limits the use of memory and cores."""

NO_ACCOUNT = "no account has this password"


class PasswordRefusedError(ValueError):
    """Raised if a new password is rejected; the message gives the reason, not the password."""


def plant_hasher() -> PasswordHasher:
    """Return an argon2id hasher with the current parameters."""
    return PasswordHasher(time_cost=TIME_COST, memory_cost=MEMORY_KIB, parallelism=PARALLELISM)


def new_password(written: str, name: str) -> str:
    """Check the new password `written` for an account; return it in Unicode normal form NFKC.

    The rules require length, but no classes of characters and no expiry (NIST SP 800-63B, 3.1.1).

    Raises `PasswordRefusedError` if the password is too short or too long, has too few different
    characters, or contains the name of the account.
    """
    password = _normal(written)
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
    """Password hasher with a limit on the number of concurrent computations.

    `hasher` is the argon2id hasher for new hashes, by default `plant_hasher`. Stored hashes with
    other parameters are verified too.
    """

    def __init__(self, hasher: PasswordHasher | None = None) -> None:
        self._hasher = hasher or plant_hasher()
        self._places = BoundedSemaphore(MAX_AT_ONCE)

    def hash(self, password: str) -> str:
        """Return a salted argon2id hash of a password."""
        with self._places:
            return self._hasher.hash(_bytes(password))

    def verify(self, stored: str | None, password: str) -> bool:
        """Whether a password matches a stored hash.

        Without a hash, the answer is False after the same computing time. A password above the
        maximum length never matches.
        """
        # normalise before truncation: one character may have several encodings
        tried = _bytes(_normal(password)[: MAX_LENGTH + 1])
        with self._places:
            unused = self._unused_hash  # computed once, whether the account is known or not
            try:
                self._hasher.verify(unused if stored is None else stored, tried)
            except (VerificationError, InvalidHashError):
                return False
        return stored is not None

    @cached_property
    def _unused_hash(self) -> str:
        return self._hasher.hash(NO_ACCOUNT)

    def is_outdated(self, stored: str) -> bool:
        """Whether the hash `stored` was computed with parameters other than the current ones."""
        return self._hasher.check_needs_rehash(stored)


def _normal(password: str) -> str:
    """Return the Unicode normal form NFKC of a password."""
    return unicodedata.normalize("NFKC", password)


def _bytes(password: str) -> bytes:
    """Return the bytes of a password for hashing, also with lone surrogates, as JSON allows."""
    return _normal(password).encode("utf-8", "surrogatepass")


MAX_WAITING = 16
"""Maximum number of running and queued hash computations; each takes about 0.3 s."""

MAX_KNOWN_WAITING = 8
"""Number of further queue places for accounts that have logged in from the same address."""

LOOKUP_THREADS = 2

T = TypeVar("T")


class TooManyLoginsError(Exception):
    """Raised if the queue of hash computations is full."""


class AccessThreads:
    """Thread pools for access to the store and for password hashing."""

    def __init__(self) -> None:
        self._lookups = ThreadPoolExecutor(LOOKUP_THREADS, "access")
        self._hashes = ThreadPoolExecutor(MAX_AT_ONCE, "passwords")
        self._places = BoundedSemaphore(MAX_WAITING)
        self._known_places = BoundedSemaphore(MAX_KNOWN_WAITING)

    async def run(self, look: Callable[[], T]) -> T:
        """Run a short database operation in a thread; return its result."""
        return await asyncio.wrap_future(self._lookups.submit(copy_context().run, look))

    async def run_hashing(self, work: Callable[[], T], is_known: bool = True) -> T:
        """Run a function that hashes a password in a thread; return its result.

        If the account has logged in from this address (`is_known`), it has more queue places.
        Raises `TooManyLoginsError` if the queue is full.
        """
        places = self._places
        if not places.acquire(blocking=False):
            places = self._known_places
            if not is_known or not places.acquire(blocking=False):
                raise TooManyLoginsError
        running: Future[T] = self._hashes.submit(copy_context().run, work)
        running.add_done_callback(lambda _: places.release())
        return await asyncio.wrap_future(running)

    def close(self) -> None:
        """Shut down the thread pools without waiting; cancel queued work."""
        for threads in (self._lookups, self._hashes):
            threads.shutdown(wait=False, cancel_futures=True)
