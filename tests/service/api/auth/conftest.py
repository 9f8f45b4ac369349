"""CredentialChecker on both databases, with hashes that cost little."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from argon2 import PasswordHasher
from harness.places import Place, SqlitePlace
from rigs.standing_clock import SetClock

from service.api.auth.authenticator import Authenticator
from service.api.auth.passwords import Hashing
from service.store.access.tables import AccessStore


class CountingHasher(PasswordHasher):
    """Argon2id at its cheapest, which counts what it verifies."""

    def __init__(self, time_cost: int = 1) -> None:
        super().__init__(time_cost=time_cost, memory_cost=8, parallelism=1)
        self.n_verified = 0

    def verify(self, hash: str | bytes, password: str | bytes) -> bool:  # noqa: A002
        self.n_verified += 1
        return super().verify(hash, password)  # type: ignore[return-value]


@pytest.fixture
def path(sqlite_place: SqlitePlace) -> Path:
    """Where the file is, for tests of that alone."""
    return sqlite_place.path


@pytest.fixture
def access(store_place: Place) -> Iterator[AccessStore]:
    with closing(store_place.open_access()) as opened:
        yield opened


@pytest.fixture
def hasher() -> CountingHasher:
    return CountingHasher()


@pytest.fixture
def dearer_hasher() -> CountingHasher:
    """What is in force after the parameters have risen."""
    return CountingHasher(time_cost=2)


@pytest.fixture
def hashing(hasher: CountingHasher) -> Hashing:
    return Hashing(hasher)


@pytest.fixture
def doors(access: AccessStore, hashing: Hashing) -> Authenticator:
    return Authenticator(access, SetClock(), hashing=hashing)
