"""What the API says of the plant as a whole."""

from typing import Any

import numpy as np

from core.monitor.catalogue import CATALOGUE
from core.quality import GOOD
from core.samples.blocks import DeviceClock, SampleBlock, StampFault
from core.samples.gaps import Gap, SampleAccount
from service.store.port import UnitGap


async def test_gaps_are_listed_with_their_exact_length(running: Any) -> None:
    stop_ns = 1_767_225_700_500_000_000
    running.store.append([], [UnitGap("U1", Gap(1, 60_000, 450, stop_ns))])
    running.store.append([], [UnitGap("U2", Gap(1, 0, 1, stop_ns))])
    whole = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-02T00:00:00Z"}

    assert await running.json("/api/v1/units/U1/gaps", **whole) == [
        {
            "epoch": 1,
            "first_index": 60_000,
            "n_samples": 450,
            "start": "2026-01-01T00:01:39.750Z",
            "end": "2026-01-01T00:01:40.500Z",
            "is_estimated": False,
        }
    ]
    later = {"start": "2026-01-01T00:01:41Z", "end": "2026-01-02T00:00:00Z"}
    assert await running.json("/api/v1/units/U1/gaps", **later) == []


async def test_units_say_how_their_samples_arrive(running: Any) -> None:
    account = SampleAccount(8000, 100, 50, 7, 1, {"torn": 25})
    clock = DeviceClock(offset_s=-0.25, drift_ppm=12.0, u_drift_ppm=1.5, n_faults=3)
    block = SampleBlock(
        unit="U1",
        epoch=1,
        first_index=0,
        start_ns=1_767_225_612_000_000_000,
        rate_hz=600.0,
        samples=np.zeros((1, 600), dtype=np.float32),
        channel_quality=(GOOD,),
        clock=clock,
        stamp_fault=StampFault.JUMPED,
    )
    running.live.set_received(block, account)
    running.clock.s += 4.0

    one = await running.json("/api/v1/units/U1")
    both = await running.json("/api/v1/units")

    assert one["source"] == {
        "state": "connected",
        "reason": None,
        "since": "2026-01-01T00:00:00.000Z",
        "data_age_s": 4.0,
        "last_sample_time": "2026-01-01T00:00:13.000Z",
        "n_offered": 8175,
        "n_stored": 8000,
        "n_flagged": 100,
        "n_gap": 50,
        "n_repeated": 7,
        "n_restarts": 1,
        "rejected": {"torn": 25},
        "clock": {
            "offset_s": -0.25,
            "drift_ppm": 12.0,
            "drift_uncertainty_ppm": 1.5,
            "n_stamp_faults": 3,
            "stamp_fault": "stamp_jumped",
        },
    }
    assert both[0] == one
    assert one["bearing_ids"] == ["UJB", "LJB", "TJB"]
    assert both[1]["source"]["state"] == "not_connected"
    assert both[1]["source"]["reason"] == "127.0.0.1:502: Connection refused"
    assert both[1]["source"]["data_age_s"] is None


async def test_the_overview_shows_each_bearing_and_the_catalogue_every_quantity(
    read_only: Any,
) -> None:
    overview = await read_only.json("/api/v1/overview")

    assert overview["plant"] == {"name": "Demo plant", "origin": "live"}
    assert overview["time"] == "2026-01-01T00:00:00.000Z"
    assert overview["refresh_s"] == 11.95
    assert overview["store"] == {"error": None, "n_unstored": 0}
    for unit in overview["units"]:
        assert unit["source"] == (await read_only.json(f"/api/v1/units/{unit['id']}"))["source"]
        for bearing in unit["bearings"]:
            path = f"/api/v1/units/{unit['id']}/bearings/{bearing['bearing']}/latest"
            assert await read_only.json(path) == bearing
    assert await read_only.json("/api/v1/quantities") == [
        {"name": q.name, "unit": q.unit, "label": q.label} for q in CATALOGUE
    ]
