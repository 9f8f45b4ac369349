"""Logging in and out, and what a request may show of who sends it."""

import asyncio
import threading
from collections.abc import Callable
from typing import Any

import httpx2
import pytest

from service.store.access.identities import Role
from service.store.port import StoreError

SESSION, UNITS = "/api/v1/session", "/api/v1/units"
PASSWORD = "the river is high in may"  # noqa: S105
ANNA = {"name": "anna", "password": PASSWORD}
COOKIE = "__Host-padwatch"

Token = Callable[[httpx2.Response], str]


@pytest.fixture
async def anna(access: Any) -> str:
    """Token of a session of an engineer."""
    await access.account("anna", Role.ENGINEER)
    token: str = await access.session("anna")
    return token


def cookie(token: str) -> dict[str, str]:
    return {"Cookie": f"{COOKIE}={token}"}


async def test_on_this_computer_one_sees_the_plant_and_is_told_that_an_account_is_missing(access):
    access.desk.local_role = Role.VIEWER
    async with access.client(peer="127.0.0.1") as client:
        before = (await client.get(SESSION)).json()
        await access.account("anna", Role.ENGINEER)
        after = (await client.get(SESSION)).json()

    assert (before["login_required"], before["set_up_needed"]) == (False, True)
    assert (before["name"], before["permissions"]) == (None, ["read"])
    assert after == {**before, "set_up_needed": False}


async def test_the_cookie_is_for_secure_connections_alone_where_there_is_one(access, anna):
    assert anna
    for origin, name in (
        ("http://padwatch", "padwatch"),
        ("https://padwatch", COOKIE),  # passed on by a proxy as plain HTTP
    ):
        async with access.client(Origin=origin) as client:
            begun = await client.post(SESSION, json=ANNA)
            token = begun.headers["set-cookie"].partition(";")[0].removeprefix(f"{name}=")
            seen = await client.get(UNITS, headers={"Cookie": f"{name}={token}"})
        assert begun.headers["set-cookie"].startswith(f"{name}=")
        assert ("Secure" in begun.headers["set-cookie"]) == (name == COOKIE)
        assert seen.status_code == 200


async def test_in_the_demonstration_nobody_here_has_to_log_in_but_who_comes_through_a_proxy(
    read_only,
):
    said = await read_only.json(SESSION)

    assert said["login_required"] is False
    assert said["set_up_needed"] is False
    assert (said["name"], said["role"]) == (None, "admin")
    assert len(said["permissions"]) == 5
    over = await read_only.client.get(UNITS, headers=cookie("C" * 43))
    assert over.status_code == 200  # a login that is over is none
    wrong = ("pw_nonsense", "x", "A" * 8000, "pw_' OR 1=1 --", "eyJhbGciOiJub25lIn0.e30.")
    passed_on = ("X-Forwarded-For", "Forwarded", "Via", "X-Real-IP")  # by a proxy
    for headers in (
        *({"Authorization": f"Bearer {key}"} for key in wrong),
        *({header: "127.0.0.1"} for header in passed_on),
    ):
        answer = await read_only.client.get(UNITS, headers=headers)
        assert answer.status_code == 401, headers
        assert not any(key in answer.text for key in wrong[2:])


async def test_a_login_of_the_proxy_hides_neither_a_session_nor_a_key(access, anna):
    basic = ("Authorization", "Basic cHJveHk6c2VjcmV0")
    key = ("Authorization", f"Bearer {access.key(Role.ADMIN)}")
    async with access.client() as client:
        for shown, name in (
            ([basic, ("Cookie", f"{COOKIE}={anna}")], "anna"),
            ([basic, key], "key-admin"),
        ):
            assert (await client.get(SESSION, headers=shown)).json()["name"] == name


async def test_a_known_person_gets_in_while_strangers_take_all_places(access, anna):
    assert anna  # from the same place before
    while access.desk._places.acquire(blocking=False):
        pass
    statuses = []
    for peer in ("192.0.2.7", "192.0.2.8"):
        async with access.client(peer) as client:
            statuses.append((await client.post(SESSION, json=ANNA)).status_code)
    assert statuses == [201, 503]


async def test_a_login_that_cannot_be_written_down_opens_nothing(access, anna, monkeypatch):
    def refuse(*_: object) -> None:
        raise StoreError("disk full")

    assert anna
    with monkeypatch.context() as full:
        full.setattr(access.service.access.audit._audit, "add", refuse)
        async with access.client() as client:
            answer = await client.post(SESSION, json=ANNA)
    assert answer.status_code == 503
    with access.service.access.sessions._reading() as reader:
        assert reader.execute("SELECT count(*) FROM session").fetchone()[0] == 1


async def test_a_login_never_takes_a_token_that_was_there_before(access, anna, as_token):
    made_up = "A" * 43
    tokens = {anna, made_up}
    for before in (anna, made_up):
        headers = cookie(before) | {"Origin": "http://padwatch"}
        async with access.client(**headers) as client:
            tokens.add(as_token(await client.post(SESSION, json=ANNA)))
    for before in (anna, made_up):
        async with access.client(**cookie(before)) as client:
            assert (await client.get(UNITS)).status_code == 401
    assert len(tokens) == 4


async def test_wrong_logins_do_not_say_what_was_wrong_and_after_many_one_has_to_wait(
    access, anna, as_problem
):
    assert anna
    async with access.client(peer="192.0.2.9") as client:
        wrong = [
            await client.post(SESSION, json={**ANNA, "password": f"wrong {n}"}) for n in range(5)
        ]
        answer = await client.post(SESSION, json=ANNA)
    async with access.client() as client:
        for name in ("nobody", "' OR 1=1 --", "=cmd|x", "x" * 256):
            wrong.append(await client.post(SESSION, json={**ANNA, "name": name}))

    for refused in wrong:
        assert refused.status_code == 401
        assert as_problem(refused)["detail"] == "the name or the password is wrong"
        assert "set-cookie" not in refused.headers
    assert answer.status_code == 429
    assert int(answer.headers["retry-after"]) >= 1


async def test_one_cookie_opens_what_its_role_may_and_two_are_neither(access, anna):
    async with access.client(**cookie(anna)) as client:
        found = (await client.get(SESSION)).json()
        assert (await client.get(UNITS)).status_code == 200
    assert (found["name"], found["role"], found["set_up_needed"]) == ("anna", "engineer", False)
    assert found["permissions"] == ["read", "act_on_alarms", "change_measuring", "read_audit"]
    mallory = "B" * 43
    for values in (
        [f"{COOKIE}={anna}; {COOKIE}={mallory}"],
        [f"{COOKIE}={anna}", f"{COOKIE}={mallory}"],
        [f"{COOKIE}={anna}; {COOKIE}={anna}"],
    ):
        async with access.client() as client:
            answer = await client.get(UNITS, headers=[("Cookie", value) for value in values])
        assert answer.status_code == 401, values


async def test_a_key_acts_wherever_it_is_sent_from_has_no_password_and_two_are_neither(access):
    key = ("Authorization", f"Bearer {access.key(Role.ADMIN)}")
    body = {"password": PASSWORD, "new_password": "the river is low in august"}
    async with access.client(Origin="https://elsewhere.example") as client:
        acts = await client.post("/api/v1/alarms/U1:none:x/unshelve", json={}, headers=[key])
        changes = await client.post(f"{SESSION}/password", json=body, headers=[key])
        one = await client.get(UNITS, headers=[key])
        two = await client.get(UNITS, headers=[key] * 2)

    assert [a.status_code for a in (acts, changes, one, two)] == [404, 409, 200, 401]


PAGES = (
    ({"Origin": "http://padwatch"}, 404),
    ({"Sec-Fetch-Site": "same-origin"}, 404),
    ({"Origin": "https://padwatch"}, 404),
    ({}, 403),
    ({"Origin": "null"}, 403),
    ({"Origin": "http://padwatch.evil.example"}, 403),
    ({"Origin": "http://padwatch:81"}, 403),
    ({"Origin": "http://[::1"}, 403),
    ({"Origin": "http://padwatch", "Sec-Fetch-Site": "cross-site"}, 403),
    ({"Sec-Fetch-Site": "same-site"}, 403),
)
"""What a browser says of the page that asks, and what comes of it."""


async def test_with_a_cookie_only_the_dashboard_itself_acts_and_logs_in(access, anna):
    for headers, status in PAGES:
        async with access.client(**cookie(anna), **headers) as client:
            answer = await client.post("/api/v1/alarms/U1:none:x/unshelve", json={})
        assert answer.status_code == status, headers
    async with access.client(Origin="https://elsewhere.example") as client:
        assert (await client.post(SESSION, json=ANNA)).status_code == 403


async def test_a_new_password_ends_all_other_logins_and_logout_this_one(access, anna, as_token):
    new = "the river is low in august"
    body = {"password": PASSWORD, "new_password": new}
    async with access.client(**cookie(anna), Origin="http://padwatch") as client:
        wrong = await client.post(f"{SESSION}/password", json={**body, "password": "not this"})
        weak = await client.post(f"{SESSION}/password", json={**body, "new_password": "short"})
        changed = await client.post(f"{SESSION}/password", json=body)
        old = await client.get(UNITS)
    async with access.client(**cookie(as_token(changed)), Origin="http://padwatch") as client:
        seen = await client.get(UNITS)
        out = await client.delete(SESSION)
        after = await client.get(UNITS)
        again = await client.delete(SESSION)

    assert (wrong.status_code, weak.status_code, changed.status_code) == (401, 422, 201)
    assert weak.json()["errors"][0]["parameter"] == "new_password"
    assert (old.status_code, seen.status_code) == (401, 200)
    assert (out.status_code, after.status_code, again.status_code) == (204, 401, 204)
    assert "Max-Age=0" in out.headers["set-cookie"]


async def test_the_first_account_is_made_with_the_printed_token_and_once(access):
    token = access.desk.offer_set_up()
    body = {"token": token, **ANNA}
    async with access.client() as client:
        before = (await client.get(SESSION)).json()
        refused = await client.get(UNITS)
        forged = await client.post("/api/v1/set-up", json={**body, "token": "D" * 43})
        weak = await client.post("/api/v1/set-up", json={**body, "password": "short"})
        made = await client.post("/api/v1/set-up", json=body)
        again = await client.post("/api/v1/set-up", json={**body, "name": "mallory"})
        after = (await client.get(SESSION)).json()

    assert [r.status_code for r in (forged, weak, made, again)] == [403, 422, 201, 403]
    assert before == {
        "login_required": True,
        "set_up_needed": True,
        "password_change_needed": False,
        "name": None,
        "role": None,
        "permissions": [],
    }
    assert refused.status_code == 401
    assert refused.headers["www-authenticate"].startswith("Bearer")
    assert after["set_up_needed"] is False
    assert await access.session("anna")
    assert access.desk.offer_set_up() is None


async def test_logins_are_told_and_nothing_secret_of_them(access, anna):
    async with access.client(**cookie(anna), Origin="http://padwatch") as client:
        await client.post(SESSION, json={**ANNA, "password": "quite another password"})
        await client.delete(SESSION)
    told = (await access.service.json("/api/v1/audit"))["entries"]

    assert [(entry["action"], entry["actor"], entry["peer"]) for entry in told] == [
        ("session.ended", "anna", "192.0.2.7"),
        ("request.refused", "anna", "192.0.2.7"),
        ("session.begun", "anna", "192.0.2.7"),
        ("account.added", "", None),
    ]
    assert PASSWORD not in str(told)
    assert anna not in str(told)
    assert "quite another password" not in str(told)


@pytest.fixture
def n_reads(access: Any, monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """Digest of each session that is read from the database."""
    read: list[bytes] = []
    sessions = access.service.access.sessions
    get = sessions.get

    def counted(digest: bytes) -> object:
        read.append(digest)
        return get(digest)

    monkeypatch.setattr(sessions, "get", counted)
    return read


async def test_many_polls_in_a_second_read_a_session_once_and_later_again(access, anna, n_reads):
    async with access.client(**cookie(anna)) as client:
        for n_expected in (1, 2):
            for _ in range(20):
                assert (await client.get(UNITS)).status_code == 200
            assert len(n_reads) == n_expected
            access.service.clock.s += 1.0


async def test_what_another_process_revokes_is_refused_a_second_later(access, anna):
    key = access.key(Role.VIEWER)
    now_ns, store = access.service.clock.now_ns(), access.service.access
    ways = (cookie(anna), {"Authorization": f"Bearer {key}"})
    for headers in ways:
        async with access.client(**headers) as client:
            assert (await client.get(UNITS)).status_code == 200
    store.sessions.end_all()
    store.keys.revoke(key.split("_")[1], now_ns)
    access.service.clock.s += 1.0
    for headers in ways:
        async with access.client(**headers) as client:
            assert (await client.get(UNITS)).status_code == 401


async def test_logging_out_counts_at_once_also_for_a_session_being_read(access, anna, monkeypatch):
    sessions, read, go_on = access.service.access.sessions, threading.Event(), threading.Event()
    get = sessions.get

    def slowly(digest: bytes) -> object:
        found = get(digest)
        read.set()
        go_on.wait(30.0)
        return found

    async with access.client(**cookie(anna)) as client:
        with monkeypatch.context() as slow:
            slow.setattr(sessions, "get", slowly)
            polled = asyncio.create_task(client.get(UNITS))
            await asyncio.to_thread(read.wait, 30.0)
            await access.desk.log_out(anna)
            go_on.set()
            assert (await polled).status_code == 200  # it was asked before
        assert (await client.get(UNITS)).status_code == 401


async def test_a_role_that_is_changed_here_counts_from_the_next_request(access, anna):
    await access.account("boss", Role.ADMIN)
    boss = cookie(await access.session("boss")) | {"Origin": "http://padwatch"}
    async with access.client(**cookie(anna)) as hers, access.client(**boss) as his:
        assert (await hers.get("/api/v1/audit")).status_code == 200
        for change, status in (({"role": "viewer"}, 403), ({"role": "engineer"}, 200)):
            done = await his.put("/api/v1/accounts/anna/role", json=change)
            assert done.status_code == 200
            assert (await hers.get("/api/v1/audit")).status_code == status
