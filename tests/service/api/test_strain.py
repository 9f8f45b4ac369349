"""What is refused when the service cannot keep up, in which order, and when that ends."""

import asyncio
from typing import Any

import httpx2
import pytest
from rigs.capturing import block
from starlette.responses import PlainTextResponse

from service.api.load import (
    N_CHECKS,
    LoadShedder,
    LoadWatch,
    RefusalState,
    Refused,
    advance,
    refused_from,
)
from service.measuring.acquirer import Bus

NOTHING, HISTORY, VIEWS = Refused


class SteppedBus(Bus):
    """A real bus, from which blocks are taken when a test says so."""

    def take(self) -> None:
        self._queue.get_nowait()
        self.done()


@pytest.fixture
def bus(stepped_clock: Any) -> SteppedBus:
    return SteppedBus(10, stepped_clock)


@pytest.fixture
def load(bus: SteppedBus, stepped_clock: Any) -> LoadWatch:
    return LoadWatch(bus, stepped_clock)


async def test_questions_about_the_past_are_refused_first_and_views_of_now_after_them(
    load: LoadWatch, bus: SteppedBus, stepped_clock: Any
) -> None:
    await bus.publish(block(0))
    seen = []
    for _ in range(12):
        load.look(0.0)
        seen.append(load.refused)
        stepped_clock.step(0.5)

    # two seconds late, and then four, at every look of the last four
    assert seen == [NOTHING] * 7 + [HISTORY] * 4 + [VIEWS]


async def test_a_queue_that_fills_refuses_before_it_is_full(
    load: LoadWatch, bus: SteppedBus
) -> None:
    seen = []
    for _ in range(5):
        await bus.publish(block(0))
        for _ in range(N_CHECKS):
            load.look(0.0)
        seen.append(load.refused)

    assert seen == [NOTHING, HISTORY, HISTORY, VIEWS, VIEWS]


def test_one_pause_of_the_event_loop_refuses_nothing_but_lasting_lateness_does(
    load: LoadWatch,
) -> None:
    for late_s in (9.0, 0.0, 9.0, 9.0, 9.0, 0.0):
        load.look(late_s)
        assert load.refused is NOTHING
    for _ in range(2 * N_CHECKS - 1):
        load.look(1.5)

    assert load.refused is HISTORY


def test_less_is_refused_step_by_step_when_it_has_been_enough_for_a_while() -> None:
    strain, seen = RefusalState(VIEWS), []
    for second in range(20):
        strain = advance(strain, 0.1, float(second))
        seen.append(strain.refused)

    assert seen == [VIEWS] * 5 + [HISTORY] * 6 + [NOTHING] * 9


def test_a_strain_that_comes_back_at_once_is_not_over() -> None:
    strain = RefusalState(HISTORY)
    for second in range(20):
        strain = advance(strain, 0.1 if second % 4 else 0.9, float(second))
        assert strain.refused is HISTORY


@pytest.mark.parametrize(
    ("asked", "kind"),
    [
        ("GET /livez", NOTHING),
        ("GET /readyz", NOTHING),
        ("GET /metrics", NOTHING),
        ("GET /api/v1/alarms", NOTHING),
        ("GET /api/v1/alarms/U1:UJB:order1_shaft_x", NOTHING),
        ("POST /api/v1/alarms/U1:UJB:order1_shaft_x/acknowledge", NOTHING),
        ("POST /api/v1/alarms/U1:UJB:order1_shaft_x/shelve", NOTHING),
        ("POST /api/v1/session", NOTHING),
        ("GET /", NOTHING),
        ("GET /static/app.js", NOTHING),
        ("GET /api/v1/units", VIEWS),
        ("GET /api/v1/overview", VIEWS),
        ("GET /api/v1/units/U1/bearings/UJB/latest", VIEWS),
        ("GET /api/v1/units/U1/bearings/UJB/trends", HISTORY),
        ("GET /api/v1/units/U1/bearings/UJB/spectra", HISTORY),
        ("GET /api/v1/units/U1/waveform", HISTORY),
        ("GET /api/v1/alarms/rates", HISTORY),
        ("GET /api/v1/alarms/a/evidence/1/bundle", HISTORY),
        ("GET /api/v1/recordings", HISTORY),
        ("GET /api/v1/audit", HISTORY),
        ("GET /api/v1/something/new", HISTORY),
    ],
)
def test_alarms_and_actions_are_never_refused_and_the_disk_is_asked_less_before_memory(
    asked: str, kind: Refused
) -> None:
    assert refused_from(*asked.split()) is kind


async def test_what_is_refused_is_told_when_to_ask_again_and_counted(
    load: LoadWatch, bus: SteppedBus, stepped_clock: Any
) -> None:
    await bus.publish(block(0))
    app = LoadShedder(PlainTextResponse("here you are"), load)
    transport = httpx2.ASGITransport(app)
    paths = ("/api/v1/alarms", "/api/v1/units", "/api/v1/units/U1/bearings/B/trends", "/readyz")
    found = []
    async with httpx2.AsyncClient(transport=transport, base_url="http://here") as client:
        for _ in range(3):
            for _ in range(N_CHECKS):
                load.look(0.0)
            answers = await asyncio.gather(*(client.get(path) for path in paths))
            found.append([answer.status_code for answer in answers])
            stepped_clock.step(2.5)
        refused = await client.get("/api/v1/units/U1/bearings/B/trends")

    assert found == [[200] * 4, [200, 200, 503, 200], [200, 503, 503, 200]]
    assert refused.headers["retry-after"] == "10"
    assert "samples" in refused.json()["detail"]
    assert load.n_refused == {HISTORY: 3, VIEWS: 1}
