"""Alarms over HTTP: the list, the history, and what people may do."""

import asyncio
import sqlite3
from collections.abc import Callable
from contextlib import closing
from typing import Any

import httpx2
import numpy as np
import pytest

from core.blocks import SampleBlock
from core.quality import GOOD, Reading, Reason, bad
from service.api import in_process
from service.recorder import Findings

AsProblem = Callable[[httpx2.Response], dict[str, Any]]

ALARMS = "/api/v1/alarms"
PROBE = "U1:ujb_shaft_x:channel_not_ok"
ACKNOWLEDGE = f"{ALARMS}/{PROBE}/acknowledge"
SHELVE = f"{ALARMS}/{PROBE}/shelve"
ANNA = {"actor": "A. Name"}


class Probes:
    """Blocks of unit U1, in which the first probe may have failed."""

    def __init__(self, service: Any) -> None:
        self._service = service
        self.n_blocks = 0
        service.alarms.link("U1", True)

    def send(self, n_blocks: int, reason: Reason = Reason.OK) -> None:
        for _ in range(n_blocks):
            self._take(bad(reason) if reason is not Reason.OK else GOOD)

    def _take(self, first_probe: Any) -> None:
        start = self.n_blocks
        self.n_blocks += 1
        block = SampleBlock(
            unit="U1",
            epoch=1,
            first_index=start * 600,
            start_ns=1_767_225_600_000_000_000 + start * 1_000_000_000,
            rate_hz=600.0,
            samples=np.zeros((12, 600), dtype=np.float32),
            channel_quality=(first_probe,) + (GOOD,) * 11,
            slow={"speed": Reading(92.3)},
        )
        news = self._service.alarms.take(block, [])
        if news:
            self._service.recorder.put(Findings(alarms=news))

    async def stored(self) -> None:
        await asyncio.wait_for(self._service.recorder.stored(), 30)


@pytest.fixture
def probes(service: Any) -> Probes:
    return Probes(service)


async def post(service: Any, path: str, body: Any, **headers: str) -> httpx2.Response:
    response: httpx2.Response = await service.client.post(path, json=body, headers=headers)
    return response


async def test_a_plant_in_good_health_has_no_alarms(service: Any, probes: Probes) -> None:
    probes.send(3)

    found = await service.json(ALARMS)

    assert found["alarms"] == []
    assert (found["origin"], found["count"]["n_active"]) == ("live", 0)
    # U2 was never connected, and U1's device tells no time: said, but no alarm
    assert {a["unit"] for a in found["unjudged"]} == {"U1", "U2"}
    assert {a["kind"] for a in found["unjudged"] if a["unit"] == "U1"} == {
        "clock_offset",
        "clock_drift",
    }
    assert found["count"]["n_unjudged"] == len(found["unjudged"])


async def test_a_lost_probe_is_on_the_list_and_in_the_history(service: Any, probes: Probes) -> None:
    probes.send(2)
    probes.send(2, Reason.SENSOR_FAILURE)
    await probes.stored()

    [alarm] = (await service.json(ALARMS))["alarms"]
    history = await service.json(f"{ALARMS}/events", alarm=PROBE)

    assert (alarm["id"], alarm["unit"], alarm["subject"]) == (PROBE, "U1", "ujb_shaft_x")
    assert (alarm["state"], alarm["level"], alarm["occurrence"]) == ("unacknowledged", "alert", 1)
    assert (alarm["condition"], alarm["condition_reason"]) == ("active", "sensor_failure")
    assert alarm["raised"] == "2026-01-01T00:00:04.000Z"
    [event] = history["events"]
    assert (event["change"], event["reason"], event["number"]) == ("raised", "sensor_failure", 1)
    assert (event["state_before"], event["state_after"]) == ("normal", "unacknowledged")
    assert event["time"] == alarm["raised"]
    assert history["next_before"] is None
    assert (await service.json("/api/v1/overview"))["alarms"]["n_unacknowledged"] == 1


async def test_a_lost_link_makes_a_lost_probe_unknown_and_no_better(
    service: Any, probes: Probes
) -> None:
    probes.send(3, Reason.SENSOR_FAILURE)
    service.alarms.link("U1", False, "no route to host")

    [alarm] = (await service.json(ALARMS))["alarms"]

    assert (alarm["state"], alarm["is_active"]) == ("unacknowledged", True)
    assert (alarm["condition"], alarm["condition_reason"]) == ("unknown", "not_connected")


async def test_an_acknowledgement_is_durable_when_it_is_answered(
    service: Any, probes: Probes
) -> None:
    probes.send(3, Reason.SENSOR_FAILURE)

    body = {**ANNA, "occurrence": 1, "comment": "cable torn"}
    answer = await post(service, ACKNOWLEDGE, body)

    assert answer.status_code == 200
    assert answer.json()["state"] == "acknowledged"
    [stored] = service.store.alarms()
    assert stored.is_acknowledged
    first, _ = (await service.json(f"{ALARMS}/events"))["events"]
    assert (first["change"], first["actor"], first["reason"]) == (
        "acknowledged",
        "A. Name",
        "cable torn",
    )
    again = await post(service, ACKNOWLEDGE, body)
    assert again.status_code == 200
    assert len((await service.json(f"{ALARMS}/events"))["events"]) == 2


async def test_an_acknowledgement_that_crosses_a_new_occurrence_is_refused(
    service: Any, probes: Probes, as_problem: AsProblem
) -> None:
    probes.send(3, Reason.SENSOR_FAILURE)
    probes.send(12)
    probes.send(3, Reason.SENSOR_FAILURE)

    answer = await post(service, ACKNOWLEDGE, {**ANNA, "occurrence": 1})

    assert answer.status_code == 409
    assert "the newest is 2" in as_problem(answer)["detail"]
    [alarm] = (await service.json(ALARMS))["alarms"]
    assert alarm["state"] == "unacknowledged"


async def test_a_shelved_alarm_says_by_whom_why_and_until_when_and_comes_back(
    service: Any, probes: Probes
) -> None:
    probes.send(3, Reason.SENSOR_FAILURE)

    body = {**ANNA, "reason": "probe is being changed", "duration_s": 3600}
    shelved = (await post(service, SHELVE, body)).json()
    service.clock.ns += 3_599_000_000_000
    service.alarms.tick()
    still = (await service.json(ALARMS))["alarms"]
    service.clock.ns += 1_000_000_000
    service.alarms.tick()
    back = {a["id"]: a for a in (await service.json(ALARMS))["alarms"]}[PROBE]

    assert shelved["state"] == "shelved"
    assert (shelved["shelf"]["actor"], shelved["shelf"]["reason"]) == ("A. Name", body["reason"])
    assert shelved["shelf"]["until"] == "2026-01-01T01:00:00.000Z"
    assert {a["id"]: a["state"] for a in still}[PROBE] == "shelved"
    assert (back["state"], back["shelf"]) == ("unacknowledged", None)


async def test_out_of_service_and_back(service: Any, probes: Probes) -> None:
    probes.send(3, Reason.SENSOR_FAILURE)
    path = f"{ALARMS}/{PROBE}"

    out = await post(service, f"{path}/out-of-service", {**ANNA, "reason": "overhaul"})
    hidden = (await service.json(ALARMS))["count"]
    back = await post(service, f"{path}/return-to-service", ANNA)

    assert out.json()["state"] == "out_of_service"
    assert (hidden["n_active"], hidden["n_hidden"]) == (0, 1)
    assert back.json()["state"] == "unacknowledged"


@pytest.mark.parametrize(
    ("path", "body", "named"),
    [
        (ACKNOWLEDGE, {"actor": "A. Name"}, "occurrence"),
        (ACKNOWLEDGE, {"actor": "", "occurrence": 1}, "actor"),
        (ACKNOWLEDGE, {"actor": "A\nName", "occurrence": 1}, "actor"),
        (ACKNOWLEDGE, {"actor": "A" * 81, "occurrence": 1}, "actor"),
        (ACKNOWLEDGE, {"actor": "A. Name", "occurrence": "1"}, "occurrence"),
        (ACKNOWLEDGE, {"actor": "A. Name", "occurrence": 0}, "occurrence"),
        (ACKNOWLEDGE, {"actor": "A. Name", "occurrence": 1, "force": True}, "force"),
        (SHELVE, {"actor": "A. Name", "duration_s": 60.0}, "reason"),
        (SHELVE, {"actor": "A. Name", "reason": "x", "duration_s": 0.0}, "duration_s"),
        (SHELVE, {"actor": "A. Name", "reason": "x", "duration_s": 7201.0}, "duration_s"),
        (SHELVE, {"actor": "A. Name", "reason": "x", "duration_s": "1 h"}, "duration_s"),
    ],
)
async def test_what_is_asked_wrongly_is_named_and_changes_nothing(
    service: Any, probes: Probes, as_problem: AsProblem, path: str, body: Any, named: str
) -> None:
    probes.send(3, Reason.SENSOR_FAILURE)
    before = await service.json(ALARMS)

    answer = await post(service, path, body)

    assert answer.status_code == 422
    assert [mistake["parameter"] for mistake in as_problem(answer)["errors"]] == [named]
    assert (await service.json(ALARMS))["alarms"] == before["alarms"]


@pytest.mark.parametrize("alarm", ["U1:nothing:channel_not_ok", "U9:x:y", "%00", "U1", ":::"])
async def test_an_unknown_alarm_is_not_found(
    service: Any, as_problem: AsProblem, alarm: str
) -> None:
    answer = await post(service, f"{ALARMS}/{alarm}/unshelve", ANNA)

    assert answer.status_code == 404
    assert as_problem(answer)["title"] == "Unknown alarm"


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://elsewhere.example"},
        {"Origin": "null"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
)
async def test_a_page_of_another_site_cannot_acknowledge(
    service: Any, probes: Probes, as_problem: AsProblem, headers: dict[str, str]
) -> None:
    probes.send(3, Reason.SENSOR_FAILURE)

    answer = await post(service, ACKNOWLEDGE, {**ANNA, "occurrence": 1}, **headers)

    assert answer.status_code == 403
    as_problem(answer)
    [alarm] = (await service.json(ALARMS))["alarms"]
    assert alarm["state"] == "unacknowledged"


async def test_the_dashboard_of_the_service_itself_can(service: Any, probes: Probes) -> None:
    probes.send(3, Reason.SENSOR_FAILURE)
    own = {"Origin": "http://padwatch", "Sec-Fetch-Site": "same-origin"}

    answer = await post(service, ACKNOWLEDGE, {**ANNA, "occurrence": 1}, **own)

    assert answer.status_code == 200


async def test_from_another_host_nothing_is_seen_without_a_login(
    service: Any, probes: Probes
) -> None:
    probes.send(3, Reason.SENSOR_FAILURE)
    app = service.client._transport.app
    transport = httpx2.ASGITransport(app, client=("192.0.2.7", 40_000))
    async with httpx2.AsyncClient(transport=transport, base_url="http://padwatch") as elsewhere:
        acts = await elsewhere.post(ACKNOWLEDGE, json={**ANNA, "occurrence": 1})
        looks = await elsewhere.get(ALARMS)

    assert (acts.status_code, looks.status_code) == (401, 401)


async def test_a_form_of_another_page_is_no_request(service: Any, probes: Probes) -> None:
    probes.send(3, Reason.SENSOR_FAILURE)

    text = '{"actor": "A. Name", "occurrence": 1}'
    answer = await service.client.post(
        ACKNOWLEDGE, content=text, headers={"Content-Type": "text/plain"}
    )

    assert answer.status_code == 422


async def test_the_history_comes_page_by_page_and_by_what_is_asked(
    service: Any, probes: Probes
) -> None:
    for _ in range(3):
        probes.send(3, Reason.SENSOR_FAILURE)
        probes.send(12)
    await probes.stored()
    path = f"{ALARMS}/events"

    first = await service.json(path, limit=4)
    rest = await service.json(path, limit=4, before=first["next_before"])
    of_kind = await service.json(path, kind="link_lost")
    at_first = await service.json(
        path, start="2026-01-01T00:00:00Z", end="2026-01-01T00:00:10Z", unit="U1"
    )

    changes = [e["change"] for e in first["events"] + rest["events"]]
    assert changes == ["returned", "raised"] * 3
    assert rest["next_before"] is None
    assert of_kind["events"] == []
    assert [e["change"] for e in at_first["events"]] == ["raised"]


@pytest.mark.parametrize(
    ("wanted", "named"),
    [
        ({"kind": "earthquake"}, "kind"),
        ({"limit": 0}, "limit"),
        ({"limit": 1001}, "limit"),
        ({"before": 0}, "before"),
        ({"start": "2026"}, "start"),
        ({"start": "2026-01-02T00:00:00Z", "end": "2026-01-01T00:00:00Z"}, "start"),
        ({"unknown": 1}, "unknown"),
    ],
)
async def test_a_wrong_question_is_refused_by_name(
    service: Any, wanted: dict[str, object], named: str
) -> None:
    problem = await service.problem(f"{ALARMS}/events", 422, **wanted)

    assert problem["errors"][0]["parameter"] == named


async def test_while_nothing_can_be_stored_nothing_is_done(
    service: Any, probes: Probes, as_problem: AsProblem
) -> None:
    probes.send(3, Reason.SENSOR_FAILURE)
    await probes.stored()
    with closing(sqlite3.connect(service.store._path)) as connection, connection:
        connection.execute(
            "CREATE TRIGGER no BEFORE INSERT ON high_water BEGIN SELECT RAISE(ABORT, 'full'); END"
        )

    answer = await post(service, ACKNOWLEDGE, {**ANNA, "occurrence": 1})

    assert answer.status_code == 503
    assert as_problem(answer)["title"] == "Nothing was done"
    (alarm,) = (await service.json(ALARMS))["alarms"]
    assert (alarm["state"], alarm["is_acknowledged"]) == ("unacknowledged", False)
    with closing(sqlite3.connect(service.store._path)) as connection, connection:
        connection.execute("DROP TRIGGER no")
    assert (await post(service, ACKNOWLEDGE, {**ANNA, "occurrence": 1})).status_code == 200


async def test_what_cannot_be_stored_is_said_and_kept(
    service: Any, probes: Probes, monkeypatch: pytest.MonkeyPatch, as_problem: AsProblem
) -> None:
    monkeypatch.setattr(in_process, "STORED_WITHIN_S", 0.05)
    probes.send(3, Reason.SENSOR_FAILURE)
    await probes.stored()
    with sqlite3.connect(service.store._path) as connection:
        connection.execute(
            "CREATE TRIGGER no BEFORE INSERT ON alarm_event BEGIN SELECT RAISE(ABORT, 'full'); END"
        )

    answer = await post(service, ACKNOWLEDGE, {**ANNA, "occurrence": 1})

    assert answer.status_code == 503
    assert as_problem(answer)["title"] == "Not on the disk yet"
    assert not service.store.alarms()[0].is_acknowledged
    with sqlite3.connect(service.store._path) as connection:
        connection.execute("DROP TRIGGER no")
    connection.close()
    assert (await post(service, ACKNOWLEDGE, {**ANNA, "occurrence": 1})).status_code == 200
    assert service.store.alarms()[0].is_acknowledged
