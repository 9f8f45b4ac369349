"""The API where everybody must log in, with passwords whose hashes cost little."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import httpx2
import pytest
from argon2 import PasswordHasher
from rigs.described import described_app

from service.api.auth.authenticator import Authenticator
from service.api.auth.passwords import Hashing
from service.store.access.identities import Role

PASSWORD = "the river is high in may"  # noqa: S105
OWN = {"Origin": "http://padwatch"}
COOKIE = "__Host-padwatch"


@dataclass
class Access:
    """A service that asks everybody who he is."""

    desk: Authenticator
    app: Any
    service: Any

    def client(self, peer: str = "192.0.2.7", **headers: str) -> httpx2.AsyncClient:
        """A program elsewhere; it keeps no cookies that are for secure places only."""
        transport = httpx2.ASGITransport(self.app, client=(peer, 40_000))
        return httpx2.AsyncClient(transport=transport, base_url="http://padwatch", headers=headers)

    async def account(self, name: str, role: Role) -> None:
        """Add an account whose password its owner has set."""
        await asyncio.to_thread(self.desk.add, name, role, PASSWORD)

    async def session(self, name: str) -> str:
        """Log in; the token of the session."""
        async with self.client() as client:
            answer = await client.post("/api/v1/session", json={"name": name, "password": PASSWORD})
        assert answer.status_code == 201, answer.text
        return token_of(answer)

    def key(self, role: Role, *units: str, days: int = 1) -> str:
        _, shown = self.desk.create_key(f"key-{role}", role, units, days)
        return shown


def token_of(answer: httpx2.Response) -> str:
    """The session's token in the cookie of an answer, which must be of the safe kind."""
    [cookie] = answer.headers.get_list("set-cookie")
    pair, *attributes = cookie.split("; ")
    name, _, token = pair.partition("=")
    assert (name, "Secure" in attributes) in ((COOKIE, True), ("padwatch", False))
    assert {"HttpOnly", "Path=/", "SameSite=strict"} <= set(attributes)
    assert not any(attribute.startswith("Domain") for attribute in attributes)
    return token


async def no_metrics() -> bytes:
    return b""


@pytest.fixture
def access(service: Any) -> Access:
    """A second application over the same store, which asks everybody."""
    context = service.context
    hashing = Hashing(PasswordHasher(time_cost=1, memory_cost=8, parallelism=1))
    desk = Authenticator(service.access, service.clock, local_role=None, hashing=hashing)
    app = described_app(replace(context, access=desk, metrics=no_metrics), service.desk)
    return Access(desk, app, service)


@pytest.fixture
def as_token() -> Callable[[httpx2.Response], str]:
    return token_of
