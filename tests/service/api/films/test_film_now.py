"""What the API says of a film now: in words, with its uncertainty, and never more than is known."""

from typing import Any

import pytest

from core.quality import Reason, bad
from service.live.live_view import LinkState

FILM = "/api/v1/units/U1/bearings/UJB/film"
LJB = "/api/v1/units/U1/bearings/LJB/film"


async def test_a_film_as_it_was_learned_is_normal_and_tells_its_condition(
    service: Any, machine: Any
) -> None:
    machine.run(30)
    found = await service.json(FILM)

    assert (found["x"]["verdict"], found["y"]["verdict"]) == ("normal", "normal")
    assert (found["is_watched"], found["is_current"], found["estimator"]) == (True, True, "dynamic")
    assert found["baseline_version"] == 1
    change = found["x"]["change"]
    assert change["low_95"] < change["percent"] < change["high_95"]
    assert abs(change["percent"]) < 4.0
    assert found["limits"] == {"alert": 0.035, "danger": 0.15}

    machine.run(2, eccentricity_ratio=0.37, oil_temperature_c=46.1)
    found = await service.json(FILM)
    condition = found["condition"]
    assert (condition["operating_state"], condition["is_settled"]) == ("full_load", True)
    cell = condition["cell"]
    assert (cell["eccentricity_low"], cell["eccentricity_high"]) == (0.35, 0.4)
    assert (cell["oil_temperature_low_c"], cell["oil_temperature_high_c"]) == (45.0, 47.5)
    assert cell["attitude_low_deg"] is None
    assert found["next_reading"] > found["time"]
    assert found["next_reading"].endswith("0:00.000Z")  # the next full period


async def test_a_softer_film_is_told_with_interval_time_scale_and_cause(
    service: Any, machine: Any
) -> None:
    machine.run(40, ln_change=-0.3)

    alarms = (await service.json("/api/v1/alarms"))["unjudged"]
    units = (await service.json("/api/v1/overview"))["units"]
    softer = (await service.json(FILM))["x"]

    assert (softer["verdict"], softer["level"], softer["reason"]) == ("danger", "danger", "ok")
    change = softer["change"]
    assert change["low_95"] < change["percent"] < change["high_95"] < -15.0
    assert change["ln"] < 0.0
    assert change["time_scale_h"] in (4.0, 16.0)
    assert change["significance"] > change["significance_wanted"] >= 3.0
    assert change["as_of"] == (await service.json(FILM))["time"]
    assert softer["deviation"]["percent"] == pytest.approx(-25.9, abs=0.1)
    assert softer["cause"]["cause"] == "unknown"  # nobody has learned how the shaft answers
    assert "response" in softer["cause"]["reason"]
    require_a_word_for_every_film(*units)
    require_the_condition_of_each_film({a["id"]: a["film"] for a in alarms if a["unit"] == "U1"})


def require_a_word_for_every_film(first: Any, second: Any) -> None:
    assert [film["bearing"] for film in first["films"]] == ["UJB", "LJB", "TJB"]
    assert first["films"][0]["x"]["verdict"] == "danger"
    assert first["films"][0]["x"]["change_percent"] < -10.0
    assert first["films"][1]["x"]["verdict"] == "no_baseline"
    assert {film["x"] for film in second["films"]} == {None}


def require_the_condition_of_each_film(found: dict[str, Any]) -> None:
    assert found["U1:UJB:stiffness_x"]["operating_state"] == "full_load"
    assert found["U1:UJB:stiffness_x"]["cell"]["eccentricity_low"] is not None
    assert {found[id_] for id_ in found if "stiffness" not in id_} == {None}


async def test_what_is_not_judged_is_never_called_normal_and_says_why(
    service: Any, machine: Any
) -> None:
    machine.run(40)
    said = []
    for quality, other in (
        (bad(Reason.INSUFFICIENT_EXCITATION), {}),
        (bad(Reason.CLIPPED), {}),
        (bad(Reason.CLIPPED), {"power_mw": 200.0}),
    ):
        machine.run(1, quality=quality, **other)
        said.append((await service.json(FILM))["x"])
    machine.run(4, eccentricity_ratio=0.9)
    unseen = (await service.json(FILM))["x"]
    machine.run(1, attitude_angle_deg=-120.0)
    turned = (await service.json(FILM))["x"]

    assert [(one["verdict"], one["reason"]) for one in said] == [
        ("insufficient_excitation", "insufficient_excitation"),
        ("bad_quality", "clipped"),
        ("transient", "not_settled"),
    ]
    assert {one["stiffness_n_per_m"] for one in said} == {None}
    assert (unseen["verdict"], unseen["reason"]) == ("no_baseline", "condition_not_learned")
    assert unseen["deviation"] is None
    assert (turned["verdict"], turned["reason"]) == ("no_baseline", "attitude_not_learned")
    assert (await service.json(LJB))["x"]["reason"] == "none_in_force"


async def test_nothing_old_passes_for_a_verdict_of_now(service: Any, machine: Any) -> None:
    machine.run(40, ln_change=-0.3)
    service.live.set_link("U1", LinkState.NOT_CONNECTED, "no route to host")

    lost = await service.json(FILM)

    assert (lost["x"]["verdict"], lost["x"]["reason"]) == ("no_reading", "not_connected")
    assert (lost["x"]["change"], lost["condition"], lost["next_reading"]) == (None, None, None)
    assert lost["x"]["level"] == "danger"  # what is held is held
    assert lost["is_current"] is False


async def test_a_film_that_is_not_watched_says_why(learned: Any) -> None:
    found = await learned.json("/api/v1/units/U2/bearings/UJB/film")

    assert found["is_watched"] is False
    assert "rated_power_mw" in found["why_not"]
    assert (found["x"], found["y"], found["estimator"]) == (None, None, None)
    whole = {"start": "2023-01-01T00:00:00Z", "end": "2024-06-01T00:00:00Z"}
    for unit, bearing, status, named in (
        ("U2", "UJB", 409, "rated_power_mw"),
        ("U1", "XJB", 404, "XJB"),
    ):
        path = f"/api/v1/units/{unit}/bearings/{bearing}/film/readings"
        assert named in (await learned.problem(path, status, **whole))["detail"]
