"""What the API says of a film: now, in words with its uncertainty, and as stored readings."""

import csv
import io
import math
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from core.quality import Reason, bad
from service.live.status import LinkState
from service.runtime.times import rfc3339

FILM = "/api/v1/units/U1/bearings/UJB/film"
LJB = "/api/v1/units/U1/bearings/LJB/film"


async def test_a_film_as_it_was_learned_is_normal_and_tells_its_condition(service, machine):
    machine.run(30)
    found = await service.json(FILM)

    assert (found["x"]["verdict"], found["y"]["verdict"]) == ("normal", "normal")
    assert (found["is_watched"], found["is_current"], found["estimator"]) == (True, True, "dynamic")
    assert found["baseline_version"] == 1
    change = found["x"]["change"]
    assert abs(change["percent"]) < 4.0
    assert found["limits"] == {"alert_percent": 3.5, "danger_percent": 15.0}

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


async def test_damping_over_stiffness_is_judged_beside_the_stiffness(service, machine):
    machine.run(40, ck_change=0.06)

    film = await service.json(FILM)
    x, damping = film["x"], film["x"]["damping"]
    assert (x["verdict"], x["level"]) == ("normal", None)
    assert (damping["verdict"], damping["level"]) == ("alert", "alert")
    assert film["damping_limits"] == {"alert_percent": 0.8, "danger_percent": 5.0}
    assert damping["ck_s"] / damping["expected_s"] == pytest.approx(math.exp(0.06))
    assert damping["deviation"]["percent"] == pytest.approx(6.2, abs=0.1)
    assert damping["cause"]["cause"] == "clearance"
    assert "c/k +" in damping["cause"]["reason"]
    found = service.films.conditions([service.films.newest("U1", "UJB")])["U1:UJB:film_stiffness"]
    assert found["x"].reason == "clearance_changed"
    assert (found["x"].limit, found["x"].value) == (0.8, pytest.approx(6.0, abs=1.5))

    readings = await service.json(f"{FILM}/readings", start=film["time"], end="2100-01-01T00:00Z")
    assert readings["x"]["ck_s"][-1] == pytest.approx(damping["ck_s"])
    assert (readings["x"]["ck_level"][-1], readings["x"]["level"][-1]) == ("alert", None)


async def test_a_softer_film_is_told_with_interval_time_scale_and_cause(service, machine):
    machine.run(40, ln_change=-0.3)

    alarms = (await service.json("/api/v1/alarms"))["unjudged"]
    units = (await service.json("/api/v1/overview"))["units"]
    softer = (await service.json(FILM))["x"]

    assert (softer["verdict"], softer["level"], softer["reason"]) == ("danger", "danger", "ok")
    change = softer["change"]
    assert change["percent"] < -15.0
    assert change["time_scale_h"] in (4.0, 16.0)
    assert change["significance"] > change["significance_wanted"] >= 3.0
    assert change["as_of"] == (await service.json(FILM))["time"]
    deviation = softer["deviation"]
    assert deviation["percent"] == pytest.approx(-25.9, abs=0.1)
    assert deviation["low_95"] < 100.0 * math.expm1(-0.3) < deviation["high_95"]
    ratio = softer["stiffness_n_per_m"] / softer["expected_n_per_m"]
    assert 100.0 * (ratio - 1.0) == pytest.approx(deviation["percent"])
    [alarm] = [one for one in alarms if one["id"] == "U1:UJB:film_stiffness"]
    assert alarm["evidence"] == softer["cause"]["reason"]
    assert alarm["value_unit"] == "%"
    assert softer["cause"]["cause"] == "unknown"  # nobody has learned how the shaft answers
    assert "response" in softer["cause"]["reason"]
    require_a_word_for_every_film(*units)
    require_the_condition_of_each_film({a["id"]: a["film"] for a in alarms if a["unit"] == "U1"})


def require_a_word_for_every_film(first: Any, second: Any) -> None:
    films = [bearing["film"] for bearing in first["bearings"]]
    assert films[0]["x"]["verdict"] == "danger"
    assert films[0]["x"]["change_percent"] < -10.0
    assert films[0]["x"]["deviation_percent"] == pytest.approx(-25.9, abs=0.1)
    assert (first["operating_state"], first["is_settled"]) == ("full_load", True)
    assert films[1]["x"]["verdict"] == "no_baseline"
    assert {bearing["film"]["x"] for bearing in second["bearings"]} == {None}


def require_the_condition_of_each_film(found: dict[str, Any]) -> None:
    assert found["U1:UJB:film_stiffness"]["operating_state"] == "full_load"
    assert found["U1:UJB:film_stiffness"]["cell"]["eccentricity_low"] is not None
    assert {found[id_] for id_ in found if "stiffness" not in id_} == {None}


async def test_what_is_not_judged_is_never_called_normal_and_says_why(service, machine):
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


async def test_nothing_old_passes_for_a_verdict_of_now(service, machine):
    machine.run(40, ln_change=-0.3)
    service.live.set_link("U1", LinkState.NOT_CONNECTED, "no route to host")

    lost = await service.json(FILM)

    assert (lost["x"]["verdict"], lost["x"]["reason"]) == ("no_reading", "not_connected")
    assert (lost["x"]["change"], lost["condition"], lost["next_reading"]) == (None, None, None)
    assert lost["x"]["level"] == "danger"  # what is held is held
    assert lost["is_current"] is False


async def test_a_film_that_is_not_watched_says_why(learned):
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


READINGS = "/api/v1/units/U1/bearings/UJB/film/readings"
DAY_NS = 86_400_000_000_000
ALL = {"start": "2023-01-01T00:00:00Z", "end": "2024-06-01T00:00:00Z"}


async def test_readings_are_the_stored_ones_with_their_conditions(learned, lived):
    end = rfc3339(int(lived.time_ns[0]) + DAY_NS)
    found = await learned.json(READINGS, start=ALL["start"], end=end)

    n = found["n_found"]
    assert n == int(np.sum(lived.time_ns < lived.time_ns[0] + DAY_NS)) == len(found["time"])
    assert found["time"] == [*map(rfc3339, lived.time_ns[:n].tolist())]
    assert found["x"]["stiffness_n_per_m"] == pytest.approx(np.exp(lived.ln_k[0, :n]))
    assert found["y"]["u_random_n_per_m"] == pytest.approx(
        np.exp(lived.ln_k[1, :n]) * lived.u_random[1, :n]
    )
    assert found["eccentricity_ratio"] == lived.eccentricity_ratio[:n].tolist()
    assert found["oil_temperature_c"] == lived.oil_temperature_c[:n].tolist()
    assert set(found["provenance"]) == {"simulated"}
    assert set(found["x"]["verdict"]) == {"no_baseline"}
    assert set(found["baseline_version"]) == {None}
    assert set(found["operating_state"]) <= {"part_load", "full_load"}
    assert not found["is_settled"][0]
    assert found["next_end"] is None
    for series in (found["x"], found["y"]):
        assert {len(column) for column in series.values()} == {n}


async def test_more_readings_than_wanted_are_thinned_evenly_or_come_page_by_page(learned, lived):
    found = await learned.json(READINGS, **ALL, max_points=50)

    assert found["n_found"] == len(lived)
    assert len(found["time"]) == 50
    assert found["time"][0] == rfc3339(int(lived.time_ns[0]))
    assert found["time"][-1] == rfc3339(int(lived.time_ns[-1]))
    assert found["next_end"] is None

    times: list[str] = []
    end = ALL["end"]
    while end:
        page = await learned.json(READINGS, start=ALL["start"], end=end, thin=False, max_points=999)
        times = page["time"] + times
        end = page["next_end"]
    assert times == [*map(rfc3339, lived.time_ns.tolist())]


async def test_readings_are_filtered_by_state_eccentricity_and_oil(learned, lived):
    found = await learned.json(
        READINGS,
        **ALL,
        state="full_load",
        eccentricity_min=0.4,
        eccentricity_max=0.45,
        oil_temperature_min=45,
        max_points=20_000,
    )

    e, oil_c = np.array(found["eccentricity_ratio"]), np.array(found["oil_temperature_c"])
    assert 0 < e.size < len(lived)
    assert np.all((e >= 0.4) & (e <= 0.45) & (oil_c >= 45.0))
    assert set(found["operating_state"]) == {"full_load"}


async def test_what_is_measured_is_told_from_what_was_simulated(service, machine):
    machine.run(30)

    found = await service.json(READINGS, **ALL, thin=False, max_points=31)

    assert found["provenance"] == ["simulated"] + ["measured"] * 30
    assert found["x"]["verdict"][-1] == "normal"
    assert found["baseline_version"][-1] == 1
    assert found["x"]["deviation_percent"][-1] == pytest.approx(0.0, abs=1e-6)
    assert found["x"]["deviation_percent"][0] is None


async def test_readings_of_a_film_are_the_same_numbers_as_a_file(learned, lived):
    asked = {**ALL, "end": rfc3339(int(lived.time_ns[0]) + DAY_NS)}
    found = await learned.json(READINGS, **asked)

    text = (await learned.get(READINGS, **asked, format="csv")).text
    file = (await learned.get(READINGS, **asked, format="parquet")).content

    rows, table = list(csv.DictReader(io.StringIO(text))), pq.read_table(io.BytesIO(file))
    assert len(rows) == table.num_rows == found["n_found"]
    k = [float(row["x_stiffness_n_per_m [N/m]"] or "nan") for row in rows]
    assert [None if np.isnan(value) else value for value in k] == found["x"]["stiffness_n_per_m"]
    assert table["y_shaft_um_pk"].to_pylist() == found["y"]["shaft_um_pk"]
    assert {row["provenance"] for row in rows} == {"simulated"}
    assert rows[0]["time_utc"] == rfc3339(int(lived.time_ns[0]))
    assert [float(row["oil_temperature_c [°C]"]) for row in rows] == found["oil_temperature_c"]
