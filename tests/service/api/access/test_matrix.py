"""Every operation × role × state: let in is exactly who is declared here, and each declares."""

import json
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import pytest
from fastapi import APIRouter, FastAPI
from rigs.tiers import covering, first_fast
from starlette.responses import PlainTextResponse
from starlette.routing import Mount

from service.api.app import GuardedApi
from service.api.auth.gate import OPEN, Reach, UndeclaredRouteError, declared, needs
from service.dashboard.assets import edition
from service.store.access.identities import Permission, Role, new_key, new_token

ROLES = ("viewer", "operator", "engineer", "admin")
NO_ROLE = None
UNIT, PLANT, NO_UNIT = "unit", "plant", "no unit"


class Row(NamedTuple):
    """Who may do an operation: the lowest role, and what of the plant it is about."""

    role: str | None
    about: str = UNIT


FILM = "/api/v1/units/{unit}/bearings/{bearing}"
OF_BEARING = (
    *("latest", "spectrum", "trends", "spectra", "motion", "references"),
    *("film", "film/readings", "baselines", "order1-references"),
)
"""What is shown of a bearing below its address."""
ALARM = "/api/v1/alarms/{alarm}"
RECORDING = "/api/v1/recordings/{recording}"

TABLE = {
    "GET /livez": Row(NO_ROLE),
    "GET /readyz": Row(NO_ROLE),
    "GET /api/v1/session": Row(NO_ROLE),
    "POST /api/v1/session": Row(NO_ROLE),
    "DELETE /api/v1/session": Row(NO_ROLE),
    "POST /api/v1/session/password": Row("viewer", NO_UNIT),
    "POST /api/v1/set-up": Row(NO_ROLE),
    "GET /api/v1/overview": Row("viewer", PLANT),
    "GET /api/v1/units": Row("viewer", PLANT),
    "GET /api/v1/units/{unit}": Row("viewer"),
    "GET /api/v1/units/{unit}/channels": Row("viewer"),
    "GET /api/v1/units/{unit}/waveform": Row("viewer"),
    "GET /api/v1/units/{unit}/gaps": Row("viewer"),
    "GET /api/v1/units/{unit}/notes": Row("viewer"),
    "POST /api/v1/units/{unit}/notes": Row("operator"),
    "GET /api/v1/units/{unit}/bearings": Row("viewer"),
    "GET /api/v1/quantities": Row("viewer", NO_UNIT),
    "GET /api/v1/sources": Row("viewer", PLANT),
    "GET /api/v1/configuration": Row("viewer", PLANT),
    "GET /api/v1/configuration/schema": Row("viewer", NO_UNIT),
    "GET /api/v1/delivery": Row("viewer", NO_UNIT),
    "GET /api/v1/audit": Row("engineer", PLANT),
    f"GET {FILM}": Row("viewer"),
    **{f"GET {FILM}/{name}": Row("viewer") for name in OF_BEARING},
    f"GET {FILM}/budgets/{{quantity}}": Row("viewer"),
    f"GET {FILM}/baselines/{{version}}": Row("viewer"),
    f"GET {FILM}/baselines/{{version}}/export": Row("viewer"),
    f"POST {FILM}/baselines/{{version}}/accept": Row("engineer"),
    f"POST {FILM}/baselines/{{version}}/reject": Row("engineer"),
    f"POST {FILM}/baselines/freeze": Row("engineer"),
    f"POST {FILM}/baselines/thaw": Row("engineer"),
    f"POST {FILM}/baselines/renew": Row("engineer"),
    f"POST {FILM}/order1-references": Row("engineer"),
    "GET /api/v1/alarms": Row("viewer", PLANT),
    "GET /api/v1/alarms/events": Row("viewer", PLANT),
    "GET /api/v1/alarms/rates": Row("viewer", PLANT),
    f"GET {ALARM}": Row("viewer"),
    f"GET {ALARM}/evidence": Row("viewer"),
    f"GET {ALARM}/evidence/{{occurrence}}": Row("viewer"),
    f"GET {ALARM}/evidence/{{occurrence}}/report": Row("viewer"),
    f"GET {ALARM}/evidence/{{occurrence}}/bundle.zip": Row("viewer"),
    f"POST {ALARM}/acknowledge": Row("operator"),
    f"POST {ALARM}/shelve": Row("operator"),
    f"POST {ALARM}/unshelve": Row("operator"),
    f"POST {ALARM}/reset": Row("operator"),
    f"POST {ALARM}/comment": Row("operator"),
    f"POST {ALARM}/out-of-service": Row("engineer"),
    f"POST {ALARM}/return-to-service": Row("engineer"),
    "GET /api/v1/recordings": Row("viewer", PLANT),
    f"GET {RECORDING}": Row("viewer", PLANT),
    f"GET {RECORDING}/files.zip": Row("viewer", PLANT),
    f"GET {RECORDING}/samples.csv": Row("viewer", PLANT),
    f"GET {RECORDING}/motion": Row("viewer", PLANT),
    "GET /api/v1/accounts": Row("admin", NO_UNIT),
    "POST /api/v1/accounts": Row("admin", NO_UNIT),
    "PUT /api/v1/accounts/{name}/role": Row("admin", NO_UNIT),
    "PUT /api/v1/accounts/{name}/password": Row("admin", NO_UNIT),
    "DELETE /api/v1/accounts/{name}": Row("admin", NO_UNIT),
    "GET /api/v1/keys": Row("admin", NO_UNIT),
    "POST /api/v1/keys": Row("admin", NO_UNIT),
    "DELETE /api/v1/keys/{key}": Row("admin", NO_UNIT),
    "GET /metrics": Row("viewer", PLANT),
}
"""A new operation needs a row here."""

ELSEWHERE = {"/", "/docs", f"/static/{edition()}/app.js", "/api/v1/openapi.json"}
"""What is not in the published description, and open."""

PLACES = {
    "bearing": "UJB",
    "quantity": "oil_temperature_c",
    "version": "1",
    "occurrence": "1",
    "recording": "none",
    "name": "nobody",
    "key": "0123456789ab",
}

IDLE_NS = 31 * 60 * 1_000_000_000
WAYS = ("session", "key")

Headers = dict[str, str]
Show = Callable[..., Awaitable[Headers]]


@pytest.fixture
def show(access: Any) -> Show:
    """Headers of somebody with a role, by one of the ways to show it, in one of its states."""

    async def shown(way: str, state: str, role: str = "admin", *units: str) -> Headers:
        if way == "key":
            key = new_key()[1] if state == "wrong" else access.key(Role(role), *units)
            if state == "revoked":
                access.service.access.keys.revoke(key.split("_")[1], access.service.clock.ns)
            if state == "expired":
                access.service.clock.ns += 25 * 3600 * 1_000_000_000
            return {"Authorization": f"Bearer {key}"}
        await access.account(f"an.{role}", Role(role))
        token = new_token() if state == "wrong" else await access.session(f"an.{role}")
        if state == "revoked":
            await access.desk.log_out(token)
        if state == "expired":
            access.service.clock.ns += IDLE_NS
        return {"Cookie": f"__Host-padwatch={token}", "Origin": "http://padwatch"}

    return shown


async def answers(access: Any, headers: Headers, unit: str = "U1") -> dict[str, int]:
    """Status of every operation; logging out comes last."""
    found = {}
    async with access.client(**headers) as client:
        for operation in sorted(TABLE, key=lambda name: name == "DELETE /api/v1/session"):
            method, path = operation.split()
            alarm = f"{unit}:ujb_shaft_x:channel_not_ok"
            path = path.format(unit=unit, alarm=alarm, **PLACES)
            body = {} if method in ("GET", "DELETE") else {"json": {}}
            found[operation] = (await client.request(method, path, **body)).status_code
    return found


def let_in(status: int) -> bool:
    assert status < 500 or status == 503, status
    return status not in (401, 403)


def test_the_table_has_a_row_for_each_operation_and_the_description_says_the_same(access):
    least = {"read": 0, "act_on_alarms": 1, "change_measuring": 2, "read_audit": 2}
    described = {
        f"{method.upper()} {path}": operation["x-padwatch-needs"]
        for path, methods in access.app.openapi()["paths"].items()
        for method, operation in methods.items()
    }
    roles = {
        name: None if needed is None else ROLES[least.get(needed, 3)]
        for name, needed in described.items()
    }

    assert roles == {name: row.role for name, row in TABLE.items()}
    undescribed = {each.path for name, each in access.app.declared.items() if name not in TABLE}

    assert undescribed == {"/api/v1/openapi.json"}


def test_whoever_asks_for_the_description_while_it_is_made_gets_all_of_it(access):
    whole = json.dumps(access.app.openapi())
    access.app.openapi_schema = None
    with ThreadPoolExecutor(4) as threads:
        asked = [threads.submit(lambda: json.dumps(access.app.openapi())) for _ in range(4)]
    assert {each.result() for each in asked} == {whole}


@pytest.mark.parametrize(("state", "way"), covering(("wrong", "expired", "revoked"), WAYS))
async def test_what_is_no_longer_or_never_was_good_opens_nothing(access, show, way, state):
    headers = await show(way, state)
    for operation, status in (await answers(access, headers)).items():
        expected = TABLE[operation].role is NO_ROLE
        assert let_in(status) == expected, f"{operation}: {status}"
        assert expected or status == 401, f"{operation}: {status}"


async def test_who_shows_nothing_sees_nothing(access):
    for operation, status in (await answers(access, {})).items():
        assert status != 403, operation
        assert let_in(status) == (TABLE[operation].role is NO_ROLE), f"{operation}: {status}"
    async with access.client() as client:
        for path in sorted(ELSEWHERE):
            assert (await client.get(path)).status_code == 200, path
        assert (await client.get("/api/v1/no-such-thing")).status_code == 401


@pytest.mark.parametrize("local_role", ["viewer", "admin"])
async def test_on_this_computer_all_may_see_the_plant_and_only_in_the_demonstration_change_it(
    access, local_role
):
    access.desk.local_role = Role(local_role)
    for operation, status in (await answers(access, {"peer": "127.0.0.1"})).items():
        least = TABLE[operation].role
        expected = least in (NO_ROLE, "viewer") or local_role == "admin"
        assert let_in(status) == expected, f"{operation}: {status}"
        assert expected or status == 401, f"{operation}: {status}"


@pytest.mark.parametrize(("role", "way"), covering(ROLES, WAYS))
async def test_each_role_may_what_is_declared_and_nothing_else(access, show, way, role):
    headers = await show(way, "good", role)
    for operation, status in (await answers(access, headers)).items():
        least = TABLE[operation].role
        expected = least is NO_ROLE or ROLES.index(role) >= ROLES.index(least)
        if (way, operation) == ("session", "POST /api/v1/session/password"):
            assert status == 422, status  # a wrong password would be a 401, too
        assert let_in(status) == expected, f"{operation}: {status}"
        assert expected or status == 403, f"{operation}: {status}"


@pytest.mark.parametrize("role", first_fast(1, ["engineer", "operator"]))
async def test_a_key_for_some_units_opens_those_and_what_belongs_to_none(access, show, role):
    headers = await show("key", "good", role, "U1")
    for unit in ("U1", "U2"):
        for operation, status in (await answers(access, headers, unit)).items():
            row = TABLE[operation]
            expected = row.role is NO_ROLE or (
                ROLES.index(role) >= ROLES.index(row.role)
                and (row.about == NO_UNIT or (row.about == UNIT and unit == "U1"))
            )
            assert let_in(status) == expected, f"{operation}: {status}"
            assert expected or status == 403, f"{operation}: {status}"


async def test_a_cached_answer_is_confirmed_only_to_those_who_may_have_it(access, show):
    access.app = access.app.repeating(access.app, [])
    keys = [await show("key", "good", "viewer", unit) for unit in ("U1", "U2")]
    path = "/api/v1/units/U1/bearings/UJB/latest"
    async with access.client(**keys[0]) as client:
        tag = {"If-None-Match": (await client.get(path)).headers["etag"]}
        for _ in range(2):
            assert (await client.get(path, headers=tag)).status_code == 304
        assert (await client.get(f"{path}?a=1", headers=tag)).status_code == 422
        body = tag | {"Content-Type": "application/json"}
        sent = await client.request("GET", path, headers=body, content=b"{}")
        assert sent.status_code == 400
        access.service.access.keys.revoke(keys[0]["Authorization"].split("_")[1], 0)
        access.service.clock.step(1_000_000_001)
        assert (await client.get(path, headers=tag)).status_code == 401
    access.desk.local_role = Role.VIEWER
    here, session = {"peer": "127.0.0.1"}, await show("session", "good", "viewer")
    for headers in (here, session) * 2:
        async with access.client(**headers) as client:
            assert (await client.get(path)).headers["etag"] == tag["If-None-Match"]
    await access.desk.log_out(session["Cookie"].partition("=")[2])
    proxied = here | {"X-Forwarded-For": "192.0.2.7"}
    refused = ((keys[1], 403), (here | keys[1], 403), ({}, 401), (session, 401), (proxied, 401))
    for headers, status in ((here, 304), (here | keys[0], 401), *refused):
        async with access.client(**headers) as client:
            assert (await client.get(path, headers=tag)).status_code == status, headers


async def test_a_key_for_some_units_may_ask_for_the_history_of_those(access, show):
    headers = await show("key", "good", "viewer", "U1")
    asked = {
        "unit=U1": 200,
        "unit=U2": 403,
        "unit=U1&unit=U2": 403,
        "unit=U1&unit=U1": 403,
        "unit=": 403,
        "alarm=U1:ujb_shaft_x:channel_not_ok": 403,
    }
    async with access.client(**headers) as client:
        for query, status in asked.items():
            answer = await client.get(f"/api/v1/alarms/events?{query}")
            assert answer.status_code == status, query
        assert (await client.get("/api/v1/alarms/rates?unit=U1")).status_code == 200
        assert (await client.get("/api/v1/alarms/rates?unit=plant")).status_code == 403


def test_a_route_without_a_declaration_is_refused_by_its_name():
    app = GuardedApi()
    router = APIRouter(prefix="/things")
    router.add_api_route("/{thing}", lambda thing: thing, methods=["PUT"])
    app.include_router(router)

    with pytest.raises(UndeclaredRouteError, match=r"^PUT /things/\{thing\}: "):
        declared(app)


def test_what_is_no_operation_or_two_of_one_name_is_refused():
    app = FastAPI(openapi_url=None, routes=[Mount("/files", PlainTextResponse("all of them"))])
    two = FastAPI(openapi_url=None)
    for _ in range(2):
        two.add_api_route("/thing", lambda: None, dependencies=[OPEN])

    with pytest.raises(UndeclaredRouteError, match="/files"):
        declared(app)
    with pytest.raises(UndeclaredRouteError, match="occurs twice"):
        declared(two)


def test_a_routes_own_declaration_counts_before_its_routers():
    app = FastAPI(openapi_url=None)
    router = APIRouter(dependencies=[needs(Permission.READ)])
    router.add_api_route("/a", lambda: None)
    router.add_api_route("/b", lambda: None, dependencies=[needs(Permission.CHANGE_ACCESS)])
    router.add_api_route("/c", lambda: None, dependencies=[OPEN])
    app.include_router(router)
    found = declared(app)

    assert found["GET /a"].needs.permission is Permission.READ
    assert found["GET /a"].needs.reach is Reach.PLANT
    assert found["GET /b"].needs.permission is Permission.CHANGE_ACCESS
    assert [found[name].is_open for name in ("GET /a", "GET /b", "GET /c")] == [False, False, True]
