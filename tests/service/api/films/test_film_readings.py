"""Readings of films over HTTP: what was stored, with the conditions, thinned or page by page."""

import csv
import io
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from core.baseline.history import StiffnessHistory
from service.runtime.times import rfc3339

READINGS = "/api/v1/units/U1/bearings/UJB/film/readings"
DAY_NS = 86_400_000_000_000
ALL = {"start": "2023-01-01T00:00:00Z", "end": "2024-06-01T00:00:00Z"}


async def test_readings_are_the_stored_ones_with_their_conditions(
    learned: Any, lived: StiffnessHistory
) -> None:
    end = rfc3339(int(lived.time_ns[0]) + DAY_NS)
    found = await learned.json(READINGS, start=ALL["start"], end=end)

    n = found["n_found"]
    assert n == int(np.sum(lived.time_ns < lived.time_ns[0] + DAY_NS)) == len(found["time"])
    assert found["time"] == pytest.approx(lived.time_ns[:n] / 1e9)
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


async def test_more_readings_than_wanted_are_thinned_evenly_or_come_page_by_page(
    learned: Any, lived: StiffnessHistory
) -> None:
    found = await learned.json(READINGS, **ALL, max_points=50)

    assert found["n_found"] == len(lived)
    assert len(found["time"]) == 50
    assert found["time"][0] == lived.time_ns[0] / 1e9
    assert found["time"][-1] == lived.time_ns[-1] / 1e9
    assert found["next_end"] is None

    times: list[float] = []
    end = ALL["end"]
    while end:
        page = await learned.json(READINGS, start=ALL["start"], end=end, thin=False, max_points=999)
        times = page["time"] + times
        end = page["next_end"]
    assert times == (lived.time_ns / 1e9).tolist()


async def test_readings_are_filtered_by_state_eccentricity_and_oil(
    learned: Any, lived: StiffnessHistory
) -> None:
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


async def test_what_is_measured_is_told_from_what_was_simulated(service: Any, machine: Any) -> None:
    machine.run(30)

    found = await service.json(READINGS, **ALL, thin=False, max_points=31)

    assert found["provenance"] == ["simulated"] + ["measured"] * 30
    assert found["x"]["verdict"][-1] == "normal"
    assert found["baseline_version"][-1] == 1
    assert found["x"]["deviation_percent"][-1] == pytest.approx(0.0, abs=1e-6)
    assert found["x"]["deviation_percent"][0] is None


async def test_readings_of_a_film_are_the_same_numbers_as_a_file(
    learned: Any, lived: StiffnessHistory
) -> None:
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
