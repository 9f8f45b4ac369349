"""Baselines over HTTP: what was learned, and what engineers do to it."""

import numpy as np
import pytest
from rigs.probes import post

from core.baseline.baseline import BearingBaseline
from service.runtime.times import rfc3339
from service.store.documents import from_json

BASELINES = "/api/v1/units/U1/bearings/UJB/baselines"
FILM = "/api/v1/units/U1/bearings/UJB/film"
ANNA = {"actor": "A. Name", "reason": "checked against the overhaul report"}


@pytest.mark.long
async def test_versions_say_where_they_come_from_and_which_is_in_force(learned, lived):
    found = await learned.json(BASELINES)

    [version] = found["versions"]
    assert (found["in_force"], found["is_frozen"], found["estimator"]) == (1, False, "dynamic")
    assert (version["version"], version["status"], version["author"]) == (1, "in_force", "padwatch")
    assert version["learned_from"] == rfc3339(int(lived.time_ns[0]))
    assert version["learned_until"] == rfc3339(int(lived.time_ns[-1]))
    assert [(step["step"], step["actor"]) for step in found["steps"]] == [
        ("accepted", "padwatch"),
        ("learned", "padwatch"),
    ]
    assert found["learning"]["n_days"] is None  # it has been learned
    assert found["learning"]["since"] == rfc3339(int(lived.time_ns[0]))


async def test_a_bearing_without_a_baseline_says_how_far_learning_is(service, machine):
    path = "/api/v1/units/U1/bearings/LJB/baselines"
    machine.run(3)
    machine.run(2, power_mw=200.0)  # not settled: it does not count

    found = await service.json(path)

    assert (found["in_force"], found["versions"], found["steps"]) == (None, [], [])
    assert (found["learning"]["n_days"], found["learning"]["n_readings"]) == (1, 3)
    assert found["learning"]["n_days_wanted"] == 20
    assert found["learning"]["is_over"] is False
    assert found["learning"]["recent"] == {
        "days": 7.0,
        "n_at_speed": 5,
        "n_settled": 3,
        "n_complete": 3,
        "n_judged": 0,
    }


async def test_cells_and_export_are_what_was_learned(learned):
    found = await learned.json(f"{BASELINES}/1")

    baseline = learned.store.films.baseline("U1", "UJB", 1).of("k_x")
    cells, stored = found["x"]["cells"], baseline.table.cells
    assert {len(column) for column in cells.values() if column} == {len(stored)}
    assert cells["stiffness_n_per_m"] == pytest.approx([np.exp(c.location) for c in stored])
    assert cells["n_days"] == [cell.n_days for cell in stored]
    assert cells["support"] == [cell.support.value for cell in stored]
    assert {"own", "borrowed"} <= set(cells["support"])
    assert cells["scatter_percent"] == pytest.approx([100.0 * c.scatter for c in stored])
    low, high, e = (np.array(cells[f"eccentricity_{name}"]) for name in ("low", "high", "ratio"))
    assert high - low == pytest.approx(found["eccentricity_width"])
    assert np.all((low <= e) & (e <= high))
    assert found["about"]["status"] == "in_force"

    export = await learned.get(f"{BASELINES}/1/export")
    name = 'attachment; filename="U1-UJB-baseline-1.json"'
    assert export.headers["content-disposition"] == name
    assert export.headers["content-type"] == "application/json"
    assert from_json(BearingBaseline, export.text) == learned.store.films.baseline("U1", "UJB", 1)


async def test_a_rejected_baseline_is_not_in_force_and_may_be_accepted_again(service, machine):
    machine.run(2)
    rejected = await post(service, f"{BASELINES}/1/reject", ANNA)
    then = await service.json(FILM)
    accepted = await post(service, f"{BASELINES}/1/accept", {**ANNA, "reason": "it was right"})

    assert rejected.status_code == accepted.status_code == 200
    assert rejected.json()["in_force"] is None
    assert rejected.json()["versions"][0]["status"] == "rejected"
    newest = rejected.json()["steps"][0]
    assert newest["step"] == "withdrawn"
    assert {name: newest[name] for name in ANNA} == ANNA
    assert then["baseline_version"] is None
    assert (then["x"]["verdict"], then["x"]["reason"]) == ("no_reading", "baseline_changed")
    assert accepted.json()["in_force"] == 1
    assert service.films.baseline("U1", "UJB").origin.version == 1
    assert [s.actor for s in service.store.films.steps("U1", "UJB")][-2:] == ["A. Name"] * 2

    # it may be frozen, too, and thawed again
    frozen = (await post(service, f"{BASELINES}/freeze", ANNA)).json()
    thawed = (await post(service, f"{BASELINES}/thaw", ANNA)).json()

    assert (frozen["is_frozen"], frozen["versions"][0]["is_frozen"]) == (True, True)
    assert frozen["in_force"] == thawed["in_force"] == 1
    assert thawed["is_frozen"] is False


async def test_after_an_overhaul_nothing_is_in_force_until_learned(service, machine, lived):
    machine.run(1)
    event = rfc3339(int(lived.time_ns[-1]))

    answer = await post(service, f"{BASELINES}/renew", {**ANNA, "event_time": event})

    found = answer.json()
    assert (answer.status_code, found["in_force"], found["renewed"]) == (200, None, event)
    assert found["versions"][0]["status"] == "superseded"
    assert (found["steps"][0]["step"], found["steps"][0]["event_time"]) == ("renewed", event)
    assert (found["learning"]["since"], found["learning"]["n_days"]) == (event, 1)


async def test_what_does_not_fit_is_refused_and_changes_nothing(learned):
    before = await learned.json(BASELINES)

    await learned.refused(f"{BASELINES}/freeze", 403, ANNA, origin="https://elsewhere.example")
    unwatched = await learned.refused(BASELINES.replace("U1", "U2") + "/freeze", 409, ANNA)
    assert "rated_power_mw" in unwatched["detail"]
    for path, body, status, words in (
        ("1/accept", ANNA, 409, "already in force"),
        ("9/accept", ANNA, 404, "unit 'U1' bearing 'UJB' has no baseline 9"),
        ("thaw", ANNA, 409, "not frozen"),
        ("renew", {**ANNA, "event_time": "2999-01-01T00:00:00Z"}, 409, "future"),
    ):
        problem = await learned.refused(f"{BASELINES}/{path}", status, body)
        assert words in problem["detail"]
        assert await learned.json(BASELINES) == before


async def test_a_wrong_request_is_refused_by_name(learned):
    for path, body, parameter in (
        ("freeze", {"actor": "A. Name"}, "reason"),
        ("freeze", {"actor": "A. Name", "reason": " "}, "reason"),
        ("freeze", {"actor": "A. Name", "reason": "x" * 501}, "reason"),
        ("freeze", {**ANNA, "event_time": "2024-01-01T00:00:00Z"}, "event_time"),
        ("renew", ANNA, "event_time"),
        ("renew", {**ANNA, "event_time": 1704067200}, "event_time"),
        ("renew", {**ANNA, "event_time": "1969-01-01T00:00:00Z"}, "event_time"),
        ("0/accept", ANNA, "version"),
    ):
        problem = await learned.refused(f"{BASELINES}/{path}", 422, body)
        assert problem["errors"][0]["parameter"] == parameter
