"""What the API says of a bearing is what the monitor found, to the last bit; its references."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from core.monitor.assessment import Assessment
from core.monitor.catalogue import CATALOGUE
from service.api.routes.spectra import spectrum_model
from service.live.status import LinkState
from service.runtime.times import rfc3339
from service.store.references import GapReference, ReferenceSource

UJB = "/api/v1/units/U1/bearings/UJB"
K = "order1_k_eff_xx_n_per_m"
WHOLE = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-02T00:00:00Z"}


@pytest.fixture
def found(assessments: list[Assessment]) -> list[Assessment]:
    """Results of the upper bearing, oldest first."""
    return [a for a in assessments if a.bearing == "UJB"]


async def test_the_newest_readings_are_the_monitors_to_the_last_bit(read_only, found):
    body = await read_only.json(f"{UJB}/latest")

    newest = found[-1]
    assert set(body["readings"]) == {quantity.name for quantity in CATALOGUE}
    for quantity in CATALOGUE:
        shown, reading = body["readings"][quantity.name], newest.readings[quantity.name]
        assert shown["value"] == reading.value
        assert shown["level"] == reading.quality.level.name.lower()
        assert shown["reason"] == reading.quality.reason.value
    assert body["readings"][K]["value"] == pytest.approx(0.69e9, rel=0.1)
    assert body["quality"] == {"level": "good", "reason": "ok"}
    assert body["time"] == rfc3339(newest.time_ns)
    assert body["speed_source"] == "slow_channel"
    assert body["runout"] == {"shaft_x": "no_vector", "shaft_y": "no_vector"}
    assert body["window"] == {
        "epoch": newest.window.epoch,
        "first_index": newest.window.first_index,
        "last_index": newest.window.stop_index - 1,
        "n_segments": 6,
        "n_segments_wanted": 24,
        "n_voided": 0,
        "coverage": 1.0,
        "duration_s": newest.window.duration_s,
    }


async def test_a_result_that_is_too_old_or_of_a_lost_link_shows_no_number(running):
    running.clock.step(29_500_000_000)
    ageing = await running.json(f"{UJB}/latest")
    running.clock.step(1_000_000_000)
    stale = await running.json(f"{UJB}/latest")

    assert ageing["received"] == stale["received"] == "2026-01-01T00:00:00.000Z"
    assert ageing["readings"][K]["value"] is not None
    assert stale["quality"] == {"level": "bad", "reason": "stale"}
    assert {r["value"] for r in stale["readings"].values()} == {None}
    assert {r["reason"] for r in stale["readings"].values()} == {"stale"}
    assert stale["time"] == ageing["time"]

    running.live.set_link("U1", LinkState.NOT_CONNECTED, "10.0.0.7:502: timed out")

    for unit in ("U1", "U2"):
        body = await running.json(f"/api/v1/units/{unit}/bearings/UJB/latest")
        assert body["quality"] == {"level": "bad", "reason": "not_connected"}
        assert {r["value"] for r in body["readings"].values()} == {None}
        assert {r["level"] for r in body["readings"].values()} == {"bad"}
        assert {r["reason"] for r in body["readings"].values()} == {"not_connected"}
    assert body["time"] is None
    assert body["window"] is None
    problem = await running.problem("/api/v1/units/U2/bearings/UJB/spectrum", 409)
    assert "no result yet" in problem["detail"]


async def test_before_the_first_segment_a_bearing_waits_for_data(service):
    service.live.set_link("U1", LinkState.CONNECTED)

    body = await service.json(f"{UJB}/latest")

    assert body["quality"] == {"level": "bad", "reason": "waiting_for_data"}
    assert {r["value"] for r in body["readings"].values()} == {None}
    assert body["received"] is None
    assert body["speed_source"] is None
    assert body["runout"] == {"shaft_x": None, "shaft_y": None}


async def test_a_bearing_is_described_as_configured(read_only):
    one = await read_only.json(UJB)
    all_of_them = await read_only.json("/api/v1/units/U1/bearings")

    assert one == {
        "unit": "U1",
        "id": "UJB",
        "name": "upper guide",
        "bracket_stiffness_n_per_m": 1.18e9,
        "clearance_um": 200.0,
        "gap_reference_um": [2000.0, 2000.0],
        "opposite_reference_um": None,
        "reference": {"source": "plant_file", "set": None, "author": None, "note": None},
        "channels": {
            "shaft_x": "ujb_shaft_x",
            "shaft_y": "ujb_shaft_y",
            "bearing_x": "ujb_bearing_x",
            "bearing_y": "ujb_bearing_y",
        },
    }
    assert [bearing["id"] for bearing in all_of_them] == ["UJB", "LJB", "TJB"]
    assert all_of_them[0] == one


async def test_trends_are_the_stored_readings_to_the_last_bit_or_in_buckets(read_only, found):
    body = await read_only.json(
        f"{UJB}/trends",
        start="2026-01-01T00:00:00Z",
        end="2026-01-02T01:00:00+01:00",
        quantity=["speed_rpm", K],
    )

    assert body["bucket_s"] is None
    assert body["time"] == [rfc3339(a.time_ns) for a in found]
    assert (body["start"], body["end"]) == ("2026-01-01T00:00:00.000Z", "2026-01-02T00:00:00.000Z")
    assert list(body["series"]) == ["speed_rpm", K]
    series = body["series"][K]
    assert series["mean"] == series["minimum"] == series["maximum"]
    assert series["mean"] == [a.readings[K].value for a in found]
    assert series["count"] == [1] * len(found)
    assert series["worst_level"] == [a.readings[K].quality.level.name.lower() for a in found]
    assert series["unit"] == "N/m"

    minutes = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-01T00:02:00Z"}
    body = await read_only.json(f"{UJB}/trends", **minutes, quantity=K, max_points=3)
    values = [a.readings[K].value for a in found]
    assert body["bucket_s"] == 60.0
    assert body["time"] == ["2026-01-01T00:00:00.000Z", "2026-01-01T00:01:00.000Z"]
    assert sum(body["series"][K]["count"]) == len(values) == 6
    assert min(body["series"][K]["minimum"]) == min(v for v in values if v)
    assert max(body["series"][K]["maximum"]) == max(v for v in values if v)


async def test_a_hole_in_the_trend_is_a_point_without_a_value(running, found):
    late = replace(found[-1], time_ns=found[-1].time_ns + 600_000_000_000)
    running.store.append([late], [])

    body = await running.json(f"{UJB}/trends", **WHOLE, quantity=K)

    assert body["series"][K]["mean"][-2] is None
    assert body["series"][K]["worst_level"][-2] is None
    assert body["series"][K]["count"][-2:] == [0, 1]


async def test_the_spectrum_shows_lines_of_the_readings(read_only, found):
    body = await read_only.json(f"{UJB}/spectrum")

    newest = found[-1]
    frequency = np.array(body["frequency_hz"])
    shaft = np.array(body["channels"]["shaft_x"]["amplitude"])
    assert set(body["channels"]) == {"shaft_x", "shaft_y", "bearing_x", "bearing_y"}
    assert body["lines"]["order1"] == newest.readings["order1_frequency_hz"].value
    assert body["lines"]["vortex"] == newest.readings["vortex_frequency_hz"].value
    for line in body["lines"].values():
        near = np.abs(frequency - line) <= 2 * frequency[0]
        assert shaft[near].max() > 10 * np.median(shaft)
    assert shaft.tolist() == newest.spectrum.amplitude_um_pk(0).tolist()
    full = {name: np.array(body["full"]["shaft"][name]) for name in ("forward", "backward")}
    other = np.array(body["channels"]["shaft_y"]["amplitude"])
    squares = full["forward"] ** 2 + full["backward"] ** 2
    np.testing.assert_allclose(squares, (shaft**2 + other**2) / 2.0, rtol=1e-3)
    line = np.argmin(np.abs(frequency - body["lines"]["order1"]))
    assert full["forward"][line] > 2.0 * full["backward"][line]


def test_forward_is_with_the_shaft_whichever_way_it_turns(found):
    one, other = (spectrum_model(found[-1], sense).full["shaft"] for sense in (1, -1))
    assert one is not None
    assert other is not None
    assert (one.forward, one.backward) == (other.backward, other.forward)


async def test_a_channel_that_failed_has_no_spectrum(running, found):
    n_segments = found[-1].spectrum.n_segments.copy()
    n_segments[2, :] = n_segments[:, 2] = 0
    spectrum = replace(found[-1].spectrum, n_segments=n_segments)
    running.live.set_assessment(replace(found[-1], spectrum=spectrum))

    body = await running.json(f"{UJB}/spectrum")

    channels = body["channels"]
    assert (body["full"]["bearing"], body["full"]["shaft"] is None) == (None, False)
    assert channels["bearing_x"]["amplitude"] is None
    assert len(channels["bearing_y"]["amplitude"]) > 100


T0 = 1_767_225_600_000_000_000


def reference(n: int, **changes: Any) -> GapReference:
    arguments = {"opposite_reference_um": None, "source": ReferenceSource.GIVEN} | changes
    return GapReference("U1", "UJB", T0 + n * 10**9, "A. Name", (1990.0 + n, 2003.1), **arguments)


async def test_a_reference_and_its_history_have_time_author_and_note(running):
    running.store.gap_references.add(reference(1))
    known = {"source": ReferenceSource.MEASURED, "opposite_reference_um": (1.0, 2.0)}
    running.store.gap_references.add(reference(2, note="after the overhaul", **known))
    assert (await running.json(UJB))["reference"]["source"] == "plant_file"  # not yet taken over
    await running.references.look()

    body = await running.json(UJB)

    assert body["gap_reference_um"] == [1992.0, 2003.1]
    assert body["reference"] == {
        "source": "measured",
        "set": "2026-01-01T00:00:02.000Z",
        "author": "A. Name",
        "note": "after the overhaul",
    }
    assert body in await running.json("/api/v1/units/U1/bearings")
    other = await running.json("/api/v1/units/U1/bearings/LJB")
    assert other["reference"]["source"] == "plant_file"

    newest, oldest = await running.json(f"{UJB}/references")
    assert oldest == {
        "gap_reference_um": [1991.0, 2003.1],
        "opposite_reference_um": None,
        "source": "given",
        "set": "2026-01-01T00:00:01.000Z",
        "author": "A. Name",
        "note": None,
    }
    assert newest["set"] == "2026-01-01T00:00:02.000Z"
    assert newest["opposite_reference_um"] == [1.0, 2.0]
    assert await running.json("/api/v1/units/U2/bearings/UJB/references") == []


async def test_a_history_that_is_not_there_or_cannot_be_read_is_a_problem(running, tmp_path):
    for path in ("U9/bearings/UJB", "U1/bearings/XJB"):
        problem = await running.problem(f"/api/v1/units/{path}/references", 404)
        assert path.partition("/")[0] in problem["detail"]
    (tmp_path / "padwatch.sqlite3").rename(tmp_path / "away")

    problem = await running.problem(f"{UJB}/references", 503)

    assert problem["title"] == "Store not available"
