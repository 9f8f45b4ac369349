"""The audit trail over HTTP: who did what from where, and what was refused."""

import asyncio
from typing import Any

import pytest

from service.api.auth.authenticator import N_AT_ONCE, SECONDS_EACH
from service.store.access.audit_entries import AuditAction

AUDIT = "/api/v1/audit"
FREEZE = "/api/v1/units/U1/bearings/UJB/baselines/freeze"
ANNA = {"actor": "A. Name", "reason": "because"}
UNKNOWN = "/api/v1/alarms/U1:none:shaft_x/acknowledge"


async def entries(service: Any, **wanted: object) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = (await service.json(AUDIT, **wanted))["entries"]
    return found


async def test_refused_actions_are_told_with_the_reason(service):
    wrong = await service.client.post(UNKNOWN, json={"actor": ""})
    foreign = await service.client.post(
        FREEZE, json=ANNA, headers={"origin": "https://elsewhere.example"}
    )
    unfit = await service.client.post(FREEZE, json=ANNA)
    told = await entries(service)

    assert [wrong.status_code, foreign.status_code, unfit.status_code] == [422, 403, 409]
    assert {entry["chain"] for entry in told} == {"access"}
    assert [entry["after"] for entry in told] == [{"status": n} for n in (409, 403, 422)]
    assert [entry["action"] for entry in told] == ["request.refused"] * 3
    assert told[0]["object"] == f"POST {FREEZE}"
    assert told[0]["reason"] == unfit.json()["detail"]
    assert told[0]["peer"] == "127.0.0.1"


async def test_reading_is_not_recorded_however_wrong_it_is(service):
    await service.problem(AUDIT, 422, limit=0)
    await service.problem("/api/v1/units/U9", 404)
    assert await service.json(AUDIT) == {"entries": [], "next_before": None, "head_error": None}


async def test_a_flood_of_refusals_is_counted_and_not_written_one_by_one(service):
    async def flood(n_requests: int) -> None:
        async with asyncio.TaskGroup() as tasks:
            for _ in range(n_requests):
                tasks.create_task(service.client.post(UNKNOWN, json={"actor": ""}))

    await flood(N_AT_ONCE + 17)
    told = await entries(service, limit=1000)
    service.clock.s += SECONDS_EACH
    await flood(3)
    later = await entries(service, limit=1000)

    assert len(told) == N_AT_ONCE
    assert len(later) == N_AT_ONCE + 1
    assert later[0]["after"] == {"status": 422, "n_refused_more": 17}


async def test_pages_lead_from_the_newest_to_the_oldest_of_what_was_chosen(service):
    await service.client.post(UNKNOWN, json={"actor": ""})
    await require_choice(service)
    for _ in range(4):
        await service.client.post(UNKNOWN, json={"actor": ""})
    numbers, before = [], None
    while True:
        wanted = {"limit": 2} if before is None else {"limit": 2, "before": before}
        page = await service.json(AUDIT, **wanted)
        numbers += [entry["number"] for entry in page["entries"]]
        before = page["next_before"]
        if before is None:
            break
    assert numbers == [5, 4, 3, 2, 1]


@pytest.mark.long
async def test_pages_go_through_both_chains_by_time(service):
    """Also where the clock was set back, and entries are written between two pages."""
    times = {"padwatch": [1, 5, 3, 7], "access": [2, 4, 6, 8, 9]}
    stores = {"padwatch": service.store.audit, "access": service.access.audit}
    for name, audit in stores.items():
        audit.record([AuditAction(time_s * 10**9, "A", "x", name) for time_s in times[name]])
    for limit in range(1, 10):
        found, more = [], {}
        while True:
            page = await service.json(AUDIT, limit=limit, **more)
            found += [(entry["chain"], entry["number"]) for entry in page["entries"]]
            for audit in stores.values():
                audit.record([AuditAction(10**10, "B", "later", "")])
            if page["next_before"] is None:
                break
            more = {"before": page["next_before"]}
        shown = [each for each in found if each[1] <= len(times[each[0]])]
        assert shown == [
            *(("access", 5), ("access", 4), ("padwatch", 4), ("access", 3), ("access", 2)),
            *(("padwatch", 3), ("padwatch", 2), ("access", 1), ("padwatch", 1)),
        ], limit
        assert len(found) == len(set(found))


async def require_choice(service: Any) -> None:
    """The only entry is found by its actor, action, object and time, and not by others."""
    [told] = await entries(service)
    for wanted in (
        {"actor": ""},
        {"action": "request.refused"},
        {"object": f"POST {UNKNOWN}"},
        {"start": told["time"]},
        {"end": "2999-01-01T00:00:00Z"},
    ):
        assert await entries(service, **wanted) == [told], wanted
    for other in (
        {"actor": "nobody"},
        {"action": "' OR 1=1 --"},
        {"object": "\x00"},
        {"end": told["time"]},
    ):
        assert await entries(service, **other) == [], other


async def test_wrong_parameters_are_refused(read_only):
    for wrong in (
        {"limit": 1001},
        {"before": "5"},
        {"before": "access:0"},
        {"before": "access:5,access:x"},
        {"before": f"access:{2**63}"},
        {"start": "2026-01-02T00:00:00Z", "end": "2026-01-01T00:00:00Z"},
        {"actor": "x" * 301},
    ):
        await read_only.problem(AUDIT, 422, **wrong)
