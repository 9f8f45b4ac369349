"""Alarms over HTTP: the list, the history, what people may do, what is refused, who is told."""

import csv
import io
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from typing import Any

import pytest
from rigs.assessments import assessment
from rigs.probes import ACKNOWLEDGE, ALARMS, ANNA, PROBE, SHELVE, post

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.life_cycle import update
from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel, Judgement
from core.quality import Reason
from service.api.routes.alarms import N_COMMENTS, S_PER_COMMENT
from service.measuring import commands as in_process
from service.store.outbox import MessageState, OutboxMessage


async def test_a_plant_in_good_health_has_no_alarms(service, probes):
    probes.send(3)

    found = await service.json(ALARMS)

    assert found["alarms"] == []
    assert (found["origin"], found["count"]["n_active"]) == ("live", 0)
    # U2 was never connected, and U1's device tells no time: said, but no alarm
    assert {a["unit"] for a in found["unjudged"]} == {"U1", "U2"}
    of_unit = {a["kind"] for a in found["unjudged"] if a["unit"] == "U1"}
    assert of_unit == {"clock_offset", "clock_drift"}
    assert found["count"]["n_unjudged"] == len(found["unjudged"])


async def test_a_lost_probe_is_on_the_list_and_in_the_history(service, probes):
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

    service.alarms.link("U1", False, "no route to host")  # it is unknown then, and no better
    [alarm] = (await service.json(ALARMS))["alarms"]
    assert (alarm["state"], alarm["is_active"]) == ("unacknowledged", True)
    assert (alarm["condition"], alarm["condition_reason"]) == ("unknown", "not_connected")


@pytest.mark.parametrize(
    ("wanted", "other"),
    [
        ({"unit": "U1"}, {"unit": "U2"}),
        ({"subject": "ujb_shaft_x"}, {"subject": "LJB"}),
        ({"kind": "channel_not_ok"}, {"kind": "film_stiffness"}),
        ({"level": "alert"}, {"level": "danger"}),
        ({"acknowledged": False}, {"acknowledged": True}),
    ],
)
async def test_the_alarm_list_is_filtered(service, probes, wanted, other):
    probes.send(2, Reason.SENSOR_FAILURE)

    found, none = [await service.json(ALARMS, **each) for each in (wanted, other)]

    assert [alarm["id"] for alarm in found["alarms"]] == [PROBE]
    assert none["alarms"] == []
    assert found["count"] == none["count"]
    await service.problem(ALARMS, 422, level="serious")


async def test_an_acknowledgement_of_the_newest_occurrence_is_durable_if_answered(service, probes):
    probes.send(3, Reason.SENSOR_FAILURE)

    problem = await service.refused(ACKNOWLEDGE, 409, {**ANNA, "occurrence": 2})
    assert "check occurrence 1" in problem["detail"]
    [alarm] = (await service.json(ALARMS))["alarms"]
    assert alarm["state"] == "unacknowledged"
    body = {**ANNA, "occurrence": 1, "comment": "cable torn"}
    answer = await post(service, ACKNOWLEDGE, body)

    assert answer.status_code == 200
    assert answer.json()["state"] == "acknowledged"
    [stored] = service.store.alarms()
    assert stored.is_acknowledged
    first, _ = (await service.json(f"{ALARMS}/events"))["events"]
    assert (first["change"], first["actor"]) == ("acknowledged", "A. Name")
    assert first["reason"] == "cable torn"
    again = await post(service, ACKNOWLEDGE, body)
    assert again.status_code == 200
    assert len((await service.json(f"{ALARMS}/events"))["events"]) == 2


async def test_comments_without_end_have_to_wait(service, probes):
    probes.send(3, Reason.SENSOR_FAILURE)
    body = {**ANNA, "text": "seen"}
    path = f"{ALARMS}/{PROBE}/comment"
    statuses = [(await post(service, path, body)).status_code for _ in range(N_COMMENTS + 2)]
    refused = await post(service, path, body)
    service.clock.step(round(S_PER_COMMENT * 1e9))

    assert statuses == [200] * N_COMMENTS + [429] * 2
    assert refused.headers["retry-after"] == "10"
    assert (await post(service, path, body)).status_code == 200


async def test_an_alarm_comes_back_from_its_shelf_and_from_out_of_service(service, probes):
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

    path = f"{ALARMS}/{PROBE}"
    out = await post(service, f"{path}/out-of-service", {**ANNA, "reason": "overhaul"})
    hidden = (await service.json(ALARMS))["count"]
    back = await post(service, f"{path}/return-to-service", ANNA)

    assert out.json()["state"] == "out_of_service"
    assert (hidden["n_active"], hidden["n_hidden"]) == (0, 1)
    assert back.json()["state"] == "unacknowledged"


async def test_the_history_comes_page_by_page_and_by_what_is_asked(service, probes):
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


async def test_the_history_says_and_is_asked_by_the_condition_at_raising(service, probes):
    point = {"eccentricity_ratio": 0.37, "attitude_deg": 47.0, "oil_temperature_c": 46.2}
    found = assessment(attitude_angle_deg=point.pop("attitude_deg"), **point)
    settled = BearingCondition(OperatingState.FULL_LOAD, True, None)
    probes.send(3, Reason.SENSOR_FAILURE, [replace(found, condition=settled)])
    service.alarms.link("U1", False, "no route")
    service.clock.step(3_600_000_000_000)
    service.alarms.tick()
    await post(service, ACKNOWLEDGE, {**ANNA, "occurrence": 1})
    path = f"{ALARMS}/events"

    probe, link = (await service.json(ALARMS))["alarms"][::-1]
    events = {e["change"]: e for e in (await service.json(path, alarm=PROBE))["events"]}

    cell = {"eccentricity_low": 0.35, "eccentricity_high": 0.4}
    cell |= {"oil_temperature_low_c": 45.0, "oil_temperature_high_c": 47.5}
    cell |= {"attitude_low_deg": None, "attitude_high_deg": None}
    there = {"operating_state": "full_load", **point, "attitude_deg": 47.0, "cell": cell}
    assert probe["raised_at"] == events["raised"]["raised_at"] == there
    assert events["acknowledged"]["raised_at"] == there
    assert (link["kind"], link["raised_at"]["cell"]) == ("link_lost", None)
    inside = {"state": "full_load", "eccentricity_min": 0.35, "eccentricity_max": 0.4}
    inside |= {"oil_temperature_min": 45.0, "attitude_max": 50.0}
    chosen = (await service.json(path, **inside))["events"]
    assert [e["change"] for e in chosen] == ["acknowledged", "raised"]
    for outside in ({"state": "part_load"}, {"oil_temperature_min": 47.5}, {"attitude_max": 40.0}):
        assert (await service.json(path, **{**inside, **outside}))["events"] == []
    table = (await service.get(path, format="csv", alarm=PROBE, limit=1)).text
    [row] = csv.DictReader(io.StringIO(table, newline=""))
    assert row["operating_state"] == "full_load"
    assert float(row["oil_temperature_c [°C]"]) == pytest.approx(46.2)


WRONG_BODIES: list[tuple[str, Any, str]] = [
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
]


async def test_what_is_asked_wrongly_is_named_and_changes_nothing(service, probes):
    probes.send(3, Reason.SENSOR_FAILURE)
    before = await service.json(ALARMS)

    for path, body, named in WRONG_BODIES:
        problem = await service.refused(path, 422, body)

        assert [mistake["parameter"] for mistake in problem["errors"]] == [named]
        assert (await service.json(ALARMS))["alarms"] == before["alarms"]
    # a form of another page is no request either
    text, plain = '{"actor": "A. Name", "occurrence": 1}', {"Content-Type": "text/plain"}
    form = await service.client.post(ACKNOWLEDGE, content=text, headers=plain)
    assert form.status_code == 422


async def test_an_unknown_alarm_is_not_found(read_only):
    for alarm in ("U1:nothing:channel_not_ok", "U9:x:y", "%00", "U1", ":::"):
        problem = await read_only.refused(f"{ALARMS}/{alarm}/unshelve", 404, ANNA)
        assert problem["title"] == "Unknown alarm"
    for alarm in ("U1:nothing:link_lost", "U9:link:link_lost", "plant:store:results_lost", "x"):
        assert alarm in (await read_only.problem(f"{ALARMS}/{alarm}", 404))["detail"]


async def test_a_wrong_question_is_refused_by_name(read_only):
    for wanted, named in (
        ({"kind": "earthquake"}, "kind"),
        ({"limit": 0}, "limit"),
        ({"limit": 1001}, "limit"),
        ({"before": 0}, "before"),
        ({"start": "2026-01-02T00:00:00Z", "end": "2026-01-01T00:00:00Z"}, "start"),
    ):
        problem = await read_only.problem(f"{ALARMS}/events", 422, **wanted)
        assert problem["errors"][0]["parameter"] == named


@contextmanager
def refusing(service: Any, table: str) -> Iterator[None]:
    """Let the database refuse new rows of a table, as a full disk does."""
    with closing(sqlite3.connect(service.store.database._path)) as connection:
        connection.execute(
            f"CREATE TRIGGER no BEFORE INSERT ON {table} BEGIN SELECT RAISE(ABORT, 'full'); END"
        )
        yield
        connection.execute("DROP TRIGGER no")


@pytest.mark.parametrize(
    ("table", "title"),
    [("high_water", "Action not applied"), ("alarm_event", "Not stored yet")],
)
async def test_an_acknowledgement_that_cannot_be_stored_is_refused_and_may_be_repeated(
    service, probes, monkeypatch, table, title
):
    body = {**ANNA, "occurrence": 1}
    probes.send(3, Reason.SENSOR_FAILURE)
    await probes.stored()
    with refusing(service, table), monkeypatch.context() as impatient:
        impatient.setattr(in_process, "WITHIN_S", 0.5)
        assert (await service.refused(ACKNOWLEDGE, 503, body))["title"] == title
        assert not service.store.alarms()[0].is_acknowledged
    if table == "high_water":
        (alarm,) = (await service.json(ALARMS))["alarms"]
        assert (alarm["state"], alarm["is_acknowledged"]) == ("unacknowledged", False)
    assert (await post(service, ACKNOWLEDGE, body)).status_code == 200
    assert service.store.alarms()[0].is_acknowledged


async def test_nothing_is_acknowledged_while_the_database_file_is_gone(service, probes):
    body = {**ANNA, "occurrence": 1}
    probes.send(3, Reason.SENSOR_FAILURE)
    await probes.stored()
    path = service.store.database._path
    aside = path.rename(path.with_name("aside"))

    problem = await service.refused(ACKNOWLEDGE, 503, body)

    assert problem["title"] == "Action not applied"
    assert "the database file was removed while padwatch runs" in problem["detail"]
    aside.rename(path)
    assert (await post(service, ACKNOWLEDGE, body)).status_code == 200
    assert service.store.alarms()[0].is_acknowledged


ALERT = Judgement(AlarmLevel.ALERT, value=160.25, limit=150.0, reason="above_limit")


def news(subject: str) -> AlarmNews:
    identity = AlarmIdentity("U1", subject, "order1_shaft_x")
    return AlarmNews(*update(Alarm(identity), ALERT, 5, AlarmRule()))


async def test_what_waits_for_somebody_who_has_left_the_plant_file_is_not_forgotten(service, store):
    found = await service.json("/api/v1/delivery")
    assert found["receivers"] == []
    ids = iter(("a", "b", "c"))
    store._address = lambda *_: [
        OutboxMessage(
            "desk", next(ids), "{}", 10**18, is_urgent=False, is_active=True, closes=False
        )
    ]
    for subject in ("UJB", "LJB", "TJB"):
        store.append([], [], [news(subject)])
    first, second, _ = store.outbox.waiting("desk", 9)
    store.outbox.finish(first.id, MessageState.REFUSED, "410 Gone", 2 * 10**18)
    store.outbox.finish(second.id, MessageState.DELIVERED, "200", 3 * 10**18)

    found = await service.json("/api/v1/delivery")

    (desk,) = found["receivers"]
    assert (desk["id"], desk["state"], desk["kind"]) == ("desk", "not_in_the_plant_file", None)
    assert (desk["n_waiting"], desk["waiting_since"]) == (1, "2001-09-09T01:46:40.000Z")
    assert desk["n_dead"] == 1
    assert desk["last_dead"] == {
        "event_id": "a",
        "outcome": "refused",
        "reason": "410 Gone",
        "time": "2033-05-18T03:33:20.000Z",
    }
    assert desk["last_delivered"] == "2065-01-24T05:20:00.000Z"


@pytest.mark.parametrize(
    ("within", "outside"),
    [
        ({"state": "full_load"}, {"state": "part_load"}),
        ({"eccentricity_min": 0.35, "eccentricity_max": 0.4}, {"eccentricity_min": 0.4}),
        ({"oil_temperature_max": 47.5}, {"oil_temperature_min": 47.5}),
        ({"attitude_min": 47.0}, {"attitude_max": 46.9}),
    ],
)
async def test_alarms_are_filtered_by_the_condition_at_raising(service, probes, within, outside):
    place = {"eccentricity_ratio": 0.37, "attitude_angle_deg": 47.0, "oil_temperature_c": 46.2}
    settled = BearingCondition(OperatingState.FULL_LOAD, True, None)
    probes.send(3, Reason.SENSOR_FAILURE, [replace(assessment(**place), condition=settled)])

    found, none = [await service.json(ALARMS, **each) for each in (within, outside)]

    assert [alarm["id"] for alarm in found["alarms"]] == [PROBE]
    assert found["unjudged"] == []  # was never raised
    assert none["alarms"] == []
    await service.problem(ALARMS, 422, eccentricity_min=0.4, eccentricity_max=0.3)


async def test_events_are_filtered_by_subject_and_level(service, probes):
    probes.send(2, Reason.SENSOR_FAILURE)
    await probes.stored()

    events = f"{ALARMS}/events"
    [event] = (await service.json(events, subject="ujb_shaft_x", level="alert"))["events"]
    assert (event["alarm"], event["directions"]) == (PROBE, "")
    assert (await service.json(events, subject="LJB"))["events"] == []
    assert (await service.json(events, level="danger"))["events"] == []


async def test_an_alarm_says_what_it_waits_for(service, probes):
    probes.send(2, Reason.SENSOR_FAILURE)
    [active] = (await service.json(ALARMS))["alarms"]
    probes.send(2, results=[assessment()])  # well again, for less than the off-delay
    [returning] = (await service.json(ALARMS))["alarms"]

    assert (active["waits_for"], returning["waits_for"]) == (None, "normal")
    assert returning["is_active"]
