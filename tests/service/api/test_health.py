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


async def test_a_disk_that_does_not_take_results_makes_it_unready_but_not_dead(
    running: Any,
) -> None:
    running.live.store_error = "disk I/O error"
    running.live.n_unstored = 3

    response = await running.get("/readyz")

    assert response.status_code == 503
    assert response.json()["status"] == "not ready"
    assert response.json()["checks"]["store"] == "disk I/O error"
    assert (await running.get("/livez")).status_code == 200
    overview = await running.json("/api/v1/overview")
    assert overview["store"] == {"error": "disk I/O error", "n_unstored": 3}


async def test_a_loop_that_is_stuck_or_dead_is_named_and_makes_the_service_unready(
    running: Any,
) -> None:
    running.live.set_link("U1", LinkState.NOT_CONNECTED, "timed out")
    assert (await running.json("/readyz"))["status"] == "ok"  # a DAQ that is away is no reason
    running.loops |= {"record": None, "alarms": "has ended"}

    response = await running.get("/readyz")

    assert response.status_code == 503
    assert response.json()["status"] == "not ready"
    assert response.json()["checks"]["loop record"] == "alive"
    assert response.json()["checks"]["loop alarms"] == "has ended"
    assert (await running.get("/livez")).status_code == 200
