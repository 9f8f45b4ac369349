"""How often alarms come, what is said of them, and references of 1×, over HTTP."""

import asyncio
from dataclasses import replace
from typing import Any

import pytest

from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.monitor.assessment import Assessment

RATES = "/api/v1/alarms/rates"
LINK = "U1:link:link_lost"
COMMENT = f"/api/v1/alarms/{LINK}/comment"
REFERENCES = "/api/v1/units/U1/bearings/UJB/order1-references"
SECOND = 1_000_000_000


async def lose_link(service: Any, n_times: int, every_s: float) -> None:
    """Lose the link for longer than its delay, again and again; that of the other unit is fine."""
    service.alarms.link("U2", True)
    for _ in range(n_times):
        service.alarms.link("U1", False, "no route to host")
        service.clock.step(11 * SECOND)
        service.alarms.tick()
        service.alarms.link("U1", True)
        service.clock.step(round((every_s - 11.0) * SECOND))
    await asyncio.wait_for(service.recorder.stored(), 30)


async def test_a_link_that_comes_and_goes_is_counted_and_called_chattering(service):
    await lose_link(service, 4, every_s=20.0)

    found = await service.json(RATES)
    [listed] = (await service.json("/api/v1/alarms"))["alarms"]

    assert found["units"]["U1"]["n_alarms"] == found["all"]["n_alarms"] == 4
    assert found["units"]["U2"]["n_alarms"] == 0
    assert found["all"]["per_day"] == pytest.approx(4 / 7)
    assert found["all"]["most_in_10_min"] == 4
    assert found["all"]["most_frequent"] == [{"alarm": LINK, "n_alarms": 4, "share": 1.0}]
    assert (found["all"]["chattering"], found["all"]["n_fleeting"]) == ({LINK: 4}, 4)
    assert (listed["id"], listed["is_chattering"]) == (LINK, True)
    span = {"start": "2026-01-01T00:01:00Z", "end": "2026-01-02T00:01:00Z"}
    last = await service.json(RATES, unit="U1", **span)
    assert (last["start"], last["end"]) == ("2026-01-01T00:01:00.000Z", "2026-01-02T00:01:00.000Z")
    assert (last["all"]["n_alarms"], set(last["units"])) == (1, {"U1"})


async def test_what_stands_for_more_than_a_day_is_stale(service):
    service.alarms.link("U1", False, "no route to host")
    service.clock.step(11 * SECOND)
    service.alarms.tick()
    service.clock.step(86_400 * SECOND)
    before = (await service.json(RATES))["stale"]
    service.clock.step(SECOND)
    after = (await service.json(RATES))["stale"]

    assert (before, [alarm["id"] for alarm in after]) == ([], [LINK])
    assert (await service.json(RATES, unit="U2"))["stale"] == []


async def test_a_quiet_plant_has_rates_of_zero_of_spans_that_can_be_counted(read_only):
    found = await read_only.json(RATES)
    assert set(found["units"]) == {"U1", "U2"}
    assert (found["all"]["n_alarms"], found["all"]["per_day"]) == (0, 0.0)
    assert found["all"]["n_by_level"] == {"alert": 0, "danger": 0}
    assert (found["is_complete"], found["stale"]) == (True, [])
    for parameters, status, words in (
        ({"unit": "U9"}, 404, "unknown unit 'U9'"),
        ({"start": "2026-01-02T00:00:00Z", "end": "2026-01-01T00:00:00Z"}, 422, "must be before"),
        ({"start": "2020-01-01T00:00:00Z", "end": "2026-01-01T00:00:00Z"}, 422, "400 days"),
    ):
        assert words in (await read_only.problem(RATES, status, **parameters))["detail"]


async def test_a_comment_is_an_event_and_leaves_the_alarm_as_it_is(service):
    await lose_link(service, 1, every_s=20.0)
    before = await service.json(f"/api/v1/alarms/{LINK}")

    body = {"actor": "A. Name", "text": "cable 7 is being replaced"}
    response = await service.client.post(COMMENT, json=body)
    events = (await service.json("/api/v1/alarms/events", alarm=LINK))["events"]

    assert response.status_code == 200
    assert response.json() == before
    assert (events[0]["change"], events[0]["actor"]) == ("commented", "A. Name")
    assert events[0]["reason"] == "cable 7 is being replaced"
    assert events[0]["state_before"] == events[0]["state_after"] == "returned_unacknowledged"
    assert [event["number"] for event in events] == [3, 2, 1]


async def test_a_comment_has_words_on_one_line(read_only):
    for text in ("", "   ", "x" * 501, "two\nlines", 7, None):
        problem = await read_only.refused(COMMENT, 422, {"actor": "A. Name", "text": text})
        assert "text" in problem["errors"][0]["parameter"]


@pytest.fixture
def at_part_load(running: Any, assessments: list[Assessment]) -> Any:
    condition = BearingCondition(OperatingState.PART_LOAD, is_settled=True, cell=None)
    for assessment in assessments:
        running.live.set_assessment(replace(assessment, condition=condition))
    return running


async def test_a_reference_is_taken_from_the_machine_as_it_runs(at_part_load):
    body = {"actor": "E. Name", "note": "after balancing"}
    response = await at_part_load.client.post(REFERENCES, json=body)
    taken, history = response.json(), await at_part_load.json(REFERENCES)

    now = await at_part_load.json("/api/v1/units/U1/bearings/UJB/latest")
    amplitude = now["readings"]["order1_shaft_x_um_pk"]["value"]
    assert response.status_code == 200
    assert (taken["state"], taken["author"]) == ("part_load", "E. Name")
    assert taken["note"] == "after balancing"
    assert taken["vectors"]["shaft_x"]["amplitude_um_pk"] == pytest.approx(amplitude, rel=1e-3)
    assert taken["vectors"]["shaft_x"]["phase_deg"] is None  # there is no key-phase
    assert history == [taken]
    in_force = at_part_load.store.order1_references.in_force()
    assert [found.reference.state for found in in_force] == [OperatingState.PART_LOAD]


async def test_no_reference_is_taken_of_a_machine_that_nobody_sees(service):
    problem = await service.refused(REFERENCES, 409, {"actor": "E. Name"})
    assert "no current result" in problem["detail"]
    assert await service.json(REFERENCES) == []
