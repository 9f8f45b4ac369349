"""What the API says of the plant as a whole, its configuration and the health of its service."""

import json

import httpx2
import numpy as np
import pytest
from rigs.blocks import given_block

from core.monitor.catalogue import CATALOGUE
from core.quality import GOOD
from core.samples.blocks import DeviceClock, StampFault
from core.samples.gaps import Gap, SampleAccount
from service.api.routes.overview import SHOWN
from service.live.current_state import SILENT_AFTER_S
from service.live.status import LinkState
from service.settings.configuration import Configuration
from service.settings.plant import plant_file_schema
from service.store.access.audit_entries import AuditAction
from service.store.access.audit_verification import head_path
from service.store.port import UnitGap


async def test_gaps_are_listed_with_their_exact_length(running):
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


async def test_units_say_how_their_samples_arrive(running):
    account = SampleAccount(8000, 100, 50, 7, 1, {"torn": 25})
    clock = DeviceClock(offset_s=-0.25, drift_ppm=12.0, u_drift_ppm=1.5, n_faults=3)
    block = given_block(
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
    running.clock.step(4_000_000_000)

    one = await running.json("/api/v1/units/U1")
    both = await running.json("/api/v1/units")

    assert one["source"] == {
        "state": "connected",
        "reason": None,
        "since": "2026-01-01T00:00:00.000Z",
        "received": "2026-01-01T00:00:00.000Z",
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
    assert both[1]["source"]["received"] is None


async def test_the_overview_shows_each_bearing_and_the_catalogue_every_quantity(read_only):
    overview = await read_only.json("/api/v1/overview")

    assert (overview["plant"], overview["origin"]) == ("Demo plant", "live")
    assert overview["refresh_s"] == 11.95
    assert overview["store_error"] is None
    for unit in overview["units"]:
        source = (await read_only.json(f"/api/v1/units/{unit['id']}"))["source"]
        assert unit["source"] == {name: source[name] for name in ("state", "reason", "since")}
        for bearing in unit["bearings"]:
            path = f"/api/v1/units/{unit['id']}/bearings/{bearing['bearing']}/latest"
            latest = await read_only.json(path)
            bad = [one["reason"] for one in latest["readings"].values() if one["level"] == "bad"]
            assert bearing.pop("bad_reasons") == list(dict.fromkeys(bad))
            assert set(bearing.pop("film")) == {"why_not", "limits", "x", "y"}
            assert bearing.pop("doubtful_signs") == []
            assert "guide" in bearing.pop("name")
            readings = bearing.pop("readings")
            assert set(readings) == set(SHOWN)
            for name, reading in readings.items():
                whole = latest["readings"][name]
                assert (reading["level"], reading["reason"]) == (whole["level"], whole["reason"])
                if whole["value"] is None:
                    assert reading["value"] is None
                    continue
                assert reading["value"] == pytest.approx(whole["value"], rel=1e-5)
                if name.startswith("stiffness_"):
                    assert reading["uncertainty"] == pytest.approx(whole["uncertainty"], rel=1e-5)
            assert bearing.items() <= latest.items()
    quantities = await read_only.json("/api/v1/quantities")
    assert quantities[: len(CATALOGUE)] == [
        {"name": q.name, "unit": q.unit, "label": q.label} for q in CATALOGUE
    ]
    pads = [f"pad_temperature_{n}_c" for n in (1, 2, 3, 4)]
    recorded = [quantity["name"] for quantity in quantities[len(CATALOGUE) :]]
    assert recorded == [
        *pads,
        "head_m",
        "gate_opening_percent",
    ]


async def test_the_configuration_is_the_plant_file_under_the_version_of_its_evidence(read_only):
    body = await read_only.json("/api/v1/configuration")

    settings = body["settings"]
    assert settings["plant"] == {"name": "Demo plant"}
    assert [unit["id"] for unit in settings["unit"]] == ["U1", "U2"]
    document = {
        "format": "padwatch-configuration",
        "version": 1,
        "padwatch": body["padwatch"],
        "commit": body["commit"],
        "settings": settings,
    }
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    assert body["version"] == Configuration(text.encode()).version
    meaning = await read_only.get("/api/v1/configuration/schema")
    assert meaning.headers["content-type"] == "application/schema+json"
    assert meaning.json() == plant_file_schema()


async def test_a_service_that_works_is_alive_and_ready(read_only):
    assert (await read_only.json("/livez"))["status"] == "ok"
    ready = await read_only.json("/readyz")

    assert ready == {
        "status": "ok",
        "checks": {
            "unit U1": "connected",
            "unit U2": "not_connected",
            "store": "ok",
            "database": "sqlite",
            "stored data": "ok",
        },
    }


async def test_faults_of_accounts_and_audit_trail_reach_the_other_process(running, tmp_path):
    await running.serving.units._ask("access", json.dumps(["rolled back: 2"]))
    head = head_path(tmp_path / "padwatch.sqlite3")
    head.unlink(missing_ok=True)
    (head / "in the way").mkdir(parents=True)
    running.store.audit.record([AuditAction(1, "anna", "alarm.shelved", "U1")])

    assert (await running.json("/readyz"))["checks"]["stored data"] == "accounts: rolled back: 2"
    assert str(head) in (await running.json("/api/v1/audit"))["head_error"]


async def test_a_full_disk_and_a_dead_loop_are_named_and_make_it_unready_but_not_dead(running):
    running.live.set_link("U1", LinkState.NOT_CONNECTED, "timed out")
    assert (await running.json("/readyz"))["status"] == "ok"  # a DAQ that is away is no reason
    running.live.store_error = "disk I/O error"
    full = await running.get("/readyz")
    overview = await running.json("/api/v1/overview")
    assert (await running.get("/livez")).status_code == 200
    running.live.store_error = None
    running.loops |= {"record": None, "alarms": "has ended"}
    response = await running.get("/readyz")

    assert (full.status_code, full.json()["status"]) == (503, "not ready")
    assert full.json()["checks"]["store"] == "disk I/O error"
    assert overview["store_error"] == "disk I/O error"
    assert (response.status_code, response.json()["status"]) == (503, "not ready")
    assert response.json()["checks"]["loop record"] == "alive"
    assert response.json()["checks"]["loop alarms"] == "has ended"
    assert (await running.get("/livez")).status_code == 200


async def test_a_measuring_process_that_hangs_makes_it_unready(running):
    running.loops |= {"record": None}
    await running.told()
    running.clock.s += SILENT_AFTER_S + 1.0
    serving = httpx2.ASGITransport(running.app)  # which hears of nothing any more
    async with httpx2.AsyncClient(transport=serving, base_url="http://padwatch") as browser:
        ready = await browser.get("/readyz")

    assert ready.status_code == 503
    assert ready.json()["checks"]["loop record"].startswith("stuck: no report of the measuring")
    assert ready.json()["checks"]["unit U1"] == "not_connected"
    assert (await running.json("/readyz"))["checks"]["loop record"] == "alive"
