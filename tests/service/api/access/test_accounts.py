"""Accounts and keys as admins change them, the audit trail of it, and bounds of what it costs."""

import asyncio
import threading
from collections.abc import AsyncIterator, Iterator
from typing import Any

import httpx2
import pytest

from service.api.auth.authenticator import MAX_WAITING, Authenticator
from service.api.auth.passwords import MAX_AT_ONCE
from service.api.problems import ProblemError
from service.store.access.identities import Role

ACCOUNTS, KEYS = "/api/v1/accounts", "/api/v1/keys"
PASSWORD = "the river is high in may"  # noqa: S105
OTHER = "the river is low in august"
BERT = {"name": "Bert", "role": "viewer", "password": PASSWORD}
BERT_IN = {"name": "bert"}


@pytest.fixture
async def admin(access: Any) -> AsyncIterator[httpx2.AsyncClient]:
    """A browser in which an admin has logged in."""
    await access.account("anna", Role.ADMIN)
    token = await access.session("anna")
    headers = {"Cookie": f"__Host-padwatch={token}", "Origin": "http://padwatch"}
    async with access.client(**headers) as client:
        yield client


async def test_an_account_is_added_changed_and_removed(access, admin):
    added = await admin.post(ACCOUNTS, json=BERT)
    raised = await admin.put(f"{ACCOUNTS}/bert/role", json={"role": "operator"})
    listed = (await admin.get(ACCOUNTS)).json()
    token = await access.session("bert")
    changed = await admin.put(f"{ACCOUNTS}/bert/password", json={"password": OTHER})
    async with access.client(Cookie=f"__Host-padwatch={token}") as client:
        after = await client.get("/api/v1/units")
    removed = await admin.delete(f"{ACCOUNTS}/bert")

    assert (added.status_code, added.json()["name"]) == (201, "bert")
    assert raised.json()["role"] == "operator"
    assert [(a["name"], a["role"]) for a in listed] == [("anna", "admin"), ("bert", "operator")]
    assert (changed.status_code, after.status_code, removed.status_code) == (200, 401, 204)
    assert [a["name"] for a in (await admin.get(ACCOUNTS)).json()] == ["anna"]
    told = (await admin.get("/api/v1/audit", params={"actor": "anna"})).json()["entries"]
    done = ("removed", "password_set", "role_set", "added")
    assert [e["action"] for e in told] == [*(f"account.{each}" for each in done), "session.begun"]
    assert {entry["peer"] for entry in told} == {"192.0.2.7"}
    assert PASSWORD not in str(told)
    assert OTHER not in str(told)


async def test_a_password_set_by_somebody_else_opens_only_its_change(access, admin, as_token):
    await admin.post(ACCOUNTS, json=BERT)
    for password in (PASSWORD, OTHER):
        async with access.client(Origin="http://padwatch") as client:
            first = await client.post("/api/v1/session", json={**BERT_IN, "password": password})
            shown = {"Cookie": f"__Host-padwatch={as_token(first)}"}
            closed = await client.get("/api/v1/units", headers=shown)
            change = {"password": password, "new_password": "the river is gone in winter"}
            done = await client.post("/api/v1/session/password", json=change, headers=shown)
            shown = {"Cookie": f"__Host-padwatch={as_token(done)}"}
            opened = await client.get("/api/v1/units", headers=shown)
        assert (first.status_code, first.json()["password_change_needed"]) == (201, True)
        assert (closed.status_code, closed.json()["title"]) == (403, "Password change required")
        assert (done.status_code, done.json()["password_change_needed"]) == (201, False)
        assert opened.status_code == 200
        await admin.put(f"{ACCOUNTS}/bert/password", json={"password": OTHER})


async def test_what_does_not_fit_is_refused_and_said(admin):
    await admin.post(ACCOUNTS, json=BERT)
    refused = [
        (await admin.post(ACCOUNTS, json=BERT), 409, None),
        (await admin.post(ACCOUNTS, json={**BERT, "name": "x y"}), 422, "name"),
        (await admin.post(ACCOUNTS, json={**BERT, "name": "c", "password": "a"}), 422, "password"),
        (await admin.post(ACCOUNTS, json={**BERT, "role": "owner"}), 422, "role"),
        (await admin.put(f"{ACCOUNTS}/anna/role", json={"role": "viewer"}), 409, None),
        (await admin.put(f"{ACCOUNTS}/none/role", json={"role": "viewer"}), 404, None),
        (await admin.delete(f"{ACCOUNTS}/anna"), 409, None),
        (await admin.put(f"{ACCOUNTS}/anna/password", json={"password": OTHER}), 409, None),
        (await admin.delete(f"{ACCOUNTS}/none"), 404, None),
        (await admin.post(KEYS, json={"name": "k", "role": "admin", "units": ["U1"]}), 409, None),
        (
            await admin.post(KEYS, json={"name": "k", "role": "viewer", "units": ["U9"]}),
            422,
            "units",
        ),
        (await admin.post(KEYS, json={"name": "k", "role": "viewer", "days": 0}), 422, "days"),
        (await admin.delete(f"{KEYS}/none"), 404, None),
    ]
    for answer, status, parameter in refused:
        assert answer.status_code == status, answer.text
        errors = [error["parameter"] for error in answer.json()["errors"]]
        assert errors == ([] if parameter is None else [parameter])


async def test_a_key_is_shown_once_and_opens_until_it_is_revoked(access, admin):
    made = await admin.post(KEYS, json={"name": "historian", "role": "viewer", "units": ["U1"]})
    key = made.json()["key"]
    async with access.client(Authorization=f"Bearer {key}") as client:
        seen = await client.get("/api/v1/units/U1")
        listed = (await admin.get(KEYS)).json()
        revoked = [(await admin.delete(f"{KEYS}/{made.json()['id']}")).status_code for _ in "12"]
        after = await client.get("/api/v1/units/U1")

    assert (made.status_code, seen.status_code, after.status_code) == (201, 200, 401)
    assert revoked == [204, 204]
    [one] = listed
    assert (one["state"], one["units"], one["role"]) == ("valid", ["U1"], "viewer")
    assert key not in str(listed)


async def test_beside_an_action_stands_who_has_logged_in_whatever_the_body_says(access, admin):
    service = access.service
    local = await service.client.post(KEYS, json={"name": "k", "role": "viewer"})
    first = (await service.json("/api/v1/audit"))["entries"][0]
    assert (local.status_code, first["actor"], first["action"]) == (201, "local", "key.created")
    service.alarms.link("U1", False, "no route")
    service.clock.step(60_000_000_000)
    service.alarms.tick()
    [alarm] = [a.identity.id for a in service.alarms.alarms if a.level is not None]
    key = access.key(Role.OPERATOR)
    async with access.client(Authorization=f"Bearer {key}") as client:
        await client.post(
            f"/api/v1/alarms/{alarm}/comment", json={"actor": "somebody else", "text": "first"}
        )
    await admin.post(f"/api/v1/alarms/{alarm}/comment", json={"text": "second"})
    told = (await admin.get("/api/v1/audit", params={"object": alarm})).json()["entries"]

    assert [(e["actor"], e["reason"]) for e in told] == [
        ("anna", "second"),
        ("key:key-operator", "first"),
    ]


@pytest.fixture
def held() -> Iterator[threading.Event]:
    """Keeps threads that wait for it."""
    event = threading.Event()
    yield event
    event.set()


async def waiting_logins(work: Authenticator, held: threading.Event) -> list[asyncio.Task[bool]]:
    """Begin as many logins as may wait."""
    begun = [work.run_hashing(held.wait, is_known=False) for _ in range(MAX_WAITING)]
    logins = [asyncio.create_task(each) for each in begun]
    await asyncio.sleep(0)
    return logins


async def test_only_so_many_passwords_wait_and_nobody_else_for_them(access, held):
    work, logins = access.desk, await waiting_logins(access.desk, held)

    with pytest.raises(ProblemError, match="too many concurrent logins"):
        await work.run_hashing(held.wait, is_known=False)
    assert await work.run(lambda: "found") == "found"
    held.set()
    assert await asyncio.gather(*logins) == [True] * MAX_WAITING
    assert await work.run_hashing(lambda: "in") == "in"


async def test_at_the_end_nothing_more_is_begun(access, held):
    logins = await waiting_logins(access.desk, held)
    await access.desk.close()
    held.set()
    ended = await asyncio.gather(*logins, return_exceptions=True)

    begun = [each for each in ended if each is True]
    assert len(begun) <= MAX_AT_ONCE
    assert all(isinstance(e, asyncio.CancelledError) for e in ended if e is not True)
