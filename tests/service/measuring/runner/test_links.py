"""Links that fail are named and tried again; bugs are not."""

import asyncio
from typing import Any

import pytest
import structlog

from acquisition.clock import SystemClock
from acquisition.errors import ConfigError, LinkError
from core.quality import Reason
from service.live.status import LinkState, why_not_current
from service.measuring.acquirer import CONNECTS_PER_S, Bus


async def run_until(plant: Any, exhausted: asyncio.Event, **units: Any) -> None:
    running = asyncio.create_task(plant.runner(**units).run())
    waiting = asyncio.create_task(exhausted.wait())
    await asyncio.wait([running, waiting], timeout=60, return_when=asyncio.FIRST_COMPLETED)
    assert exhausted.is_set()
    running.cancel()
    await asyncio.wait([running])
    if not running.cancelled():
        await running


async def test_a_device_without_an_answer_is_tried_in_each_poll_period(plant, scripted, block):
    refusals = [[LinkError("10.0.0.7:502: Connection refused")] for _ in range(12)]
    source = scripted(*refusals, [block(0)], ends=False)

    await run_until(plant, source.exhausted, U1=source)

    waits = plant.clock.slept_s
    assert len(waits) == 12
    assert all(0.25 <= wait_s <= 0.5 for wait_s in waits)
    assert len(set(waits)) == 12  # devices that vanish together do not come back in step


async def test_a_unit_without_link_says_why_and_since_when(plant, scripted, block):
    reasons = ["10.0.0.7:502: Connection refused", "10.0.0.7:502: No route to host"]
    source = scripted(*([LinkError(reason)] for reason in reasons), [block(0)], ends=False)
    seen: list[Any] = []
    plant.clock.sleep = _noting(plant, seen, plant.clock.sleep)

    with structlog.testing.capture_logs() as said:
        await run_until(plant, source.exhausted, U1=source)

    assert [(s.state, s.reason) for s in seen] == [
        (LinkState.NOT_CONNECTED, reason) for reason in reasons
    ]
    begun_ns = plant.clock.now_ns() - round(plant.clock.s * 1e9)
    assert [s.since_ns for s in seen] == [begun_ns] * 2
    assert [entry["event"] for entry in said] == ["not connected", "connected"]
    status = plant.live.status("U1")
    assert (status.state, status.reason) == (LinkState.CONNECTED, None)
    assert status.since_ns == plant.clock.now_ns()


async def test_a_device_that_cannot_fit_is_tried_much_more_seldom(plant, scripted, block):
    wrong = [
        [ConfigError("block ring: n_channels of the device is 8, of the plant file 12")]
        for _ in range(3)
    ]
    source = scripted(*wrong, [block(0)], ends=False)

    await run_until(plant, source.exhausted, U1=source)

    assert plant.clock.slept_s == [15.0] * 3


async def test_a_link_that_delivers_and_breaks_loses_no_sample_it_delivered(plant, scripted, block):
    refused = [LinkError("refused")]
    breaking = [[block(n), LinkError("reset by peer")] for n in range(6)]
    source = scripted(refused, refused, refused, *breaking, [block(6)], ends=False)

    await run_until(plant, source.exhausted, U1=source)

    assert plant.live.status("U1").account.n_stored == 7 * 128
    assert source.n_open == 0


async def test_one_unit_without_link_does_not_hold_up_another(plant, scripted, block):
    absent = scripted(*([LinkError("no route")] for _ in range(500)), [], ends=False)
    present = scripted([block(n, "U2") for n in range(20)], ends=False)

    await run_until(plant, present.exhausted, U1=absent, U2=present)

    assert plant.live.status("U1").state is LinkState.NOT_CONNECTED
    assert plant.live.status("U2").state is LinkState.CONNECTED


async def test_devices_of_a_plant_are_called_one_after_another(plant, scripted, block):
    sources = {unit: scripted([block(0, unit)]) for unit in ("U1", "U2")}

    await asyncio.wait_for(plant.runner(**sources).run(), 30)

    assert plant.clock.slept_s == [1.0 / CONNECTS_PER_S]


async def test_a_recording_that_ends_says_so(plant, scripted, block):
    source = scripted([block(0)])

    await asyncio.wait_for(plant.runner(U1=source).run(), 30)

    status = plant.live.status("U1")
    assert (status.state, status.reason) == (LinkState.ENDED, "the recording has ended")
    assert status.account.n_stored == 128


@pytest.mark.parametrize("state", LinkState)
def test_the_last_result_of_a_recording_that_has_ended_stays(state):
    expected = {LinkState.CONNECTED: Reason.STALE, LinkState.ENDED: None}
    assert why_not_current(state, 1e6, 3.0) is expected.get(state, Reason.NOT_CONNECTED)
    assert why_not_current(state, None, 3.0) is not None


async def test_a_bug_in_a_source_ends_the_run_and_closes_all_links(plant, scripted, block):
    broken = scripted([block(0), RuntimeError("a bug")])
    healthy = scripted([block(0, "U2")], ends=False)

    with pytest.raises(ExceptionGroup) as ended:
        await asyncio.wait_for(plant.runner(U1=broken, U2=healthy).run(), 30)

    assert ended.group_contains(RuntimeError, match="a bug")
    assert (broken.n_open, healthy.n_open) == (0, 0)
    assert broken.n_connections == 1


async def test_a_bug_in_the_analysis_ends_the_run(plant, scripted, block):
    source = scripted([block(0, rate_hz=99.0)], ends=False)

    with pytest.raises(ExceptionGroup) as ended:
        await asyncio.wait_for(plant.runner(U1=source).run(), 30)

    assert ended.group_contains(ValueError, match="samples at 100.0 Hz, got 99.0 Hz")


async def test_a_full_bus_makes_the_publisher_wait_and_drops_nothing(block):
    bus = Bus(3, SystemClock())
    taken: list[int] = []

    async def publish() -> None:
        for number in range(20):
            await bus.put(block(number))
            assert bus.qsize() <= bus.maxsize

    publishing = asyncio.create_task(publish())
    async with asyncio.timeout(30):
        while not bus.full():
            await asyncio.sleep(0)
        assert bus.qsize() == 3
        while len(taken) < 20:
            found = await bus.get()
            taken.append(found.first_index // 128)
            bus.task_done()
        await publishing
        await bus.join()

    assert taken == list(range(20))


def _noting(plant: Any, seen: list[Any], sleep: Any) -> Any:
    async def noted(duration_s: float) -> None:
        seen.append(plant.live.status("U1"))
        await sleep(duration_s)

    return noted
