"""Whether supervisors are told the truth."""

from typing import Any

from service.live import LinkState


async def test_a_service_that_works_is_alive_and_ready(read_only: Any) -> None:
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


async def test_a_full_disk_and_a_dead_loop_are_named_and_make_it_unready_but_not_dead(
    running: Any,
) -> None:
    running.live.set_link("U1", LinkState.NOT_CONNECTED, "timed out")
    assert (await running.json("/readyz"))["status"] == "ok"  # a DAQ that is away is no reason
    running.live.store_error, running.live.n_unstored = "disk I/O error", 3
    full = await running.get("/readyz")
    overview = await running.json("/api/v1/overview")
    assert (await running.get("/livez")).status_code == 200
    running.live.store_error = None
    running.loops |= {"record": None, "alarms": "has ended"}
    response = await running.get("/readyz")

    assert (full.status_code, full.json()["status"]) == (503, "not ready")
    assert full.json()["checks"]["store"] == "disk I/O error"
    assert overview["store"] == {"error": "disk I/O error", "n_unstored": 3}
    assert (response.status_code, response.json()["status"]) == (503, "not ready")
    assert response.json()["checks"]["loop record"] == "alive"
    assert response.json()["checks"]["loop alarms"] == "has ended"
    assert (await running.get("/livez")).status_code == 200
