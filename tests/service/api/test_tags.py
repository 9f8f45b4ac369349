"""Answers have tags: who has seen one already is told that nothing is new, and only then."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from core.monitor.assessment import Assessment
from service.api.answers import SharedAnswer
from service.api.routes.alarm_models import AlarmListModel, alarm_list_model
from service.live.live_view import LinkState
from service.runtime.asker import ASKER, Asker
from service.settings.storage import Origin

RANGE = "start=2026-01-01T00:00:00Z&end=2026-02-01T00:00:00Z"

POLLED = (
    "overview",
    "alarms",
    "alarms/events",
    "delivery",
    "sources",
    "units",
    "units/U1/channels",
    "units/U1/bearings",
    "units/U1/bearings/UJB/latest",
    "units/U1/bearings/UJB/film",
    "units/U1/bearings/UJB/spectrum",
    "units/U1/bearings/UJB/orbit",
    "units/U1/bearings/UJB/baselines",
    f"units/U1/bearings/UJB/trends?{RANGE}&quantity=speed_rpm",
    f"units/U1/bearings/UJB/shaft-centre?{RANGE}",
    f"units/U1/bearings/UJB/spectra?{RANGE}&channel=shaft_x",
    "quantities",
    "openapi.json",
)

JUMP_S = 7.0


async def ask(service: Any, path: str, tag: str | None = None) -> Any:
    headers = {} if tag is None else {"If-None-Match": tag}
    return await service.client.get(f"/api/v1/{path}", headers=headers)


def advance(service: Any) -> None:
    """Let time pass, in which nothing happens."""
    service.clock.step(round(JUMP_S * 1e9))


async def test_who_has_an_answer_already_is_not_sent_it_again(running: Any) -> None:
    first = {path: await ask(running, path) for path in POLLED}
    advance(running)
    for path, known in first.items():
        assert known.status_code == 200, known.text
        again = await ask(running, path, known.headers["etag"])
        assert again.status_code == 304, path
        assert again.content == b""
        assert again.headers["etag"] == known.headers["etag"]
        assert "content-type" not in again.headers
    # it says when it was given, so that ages can be counted on from there
    overview = await ask(running, "overview")
    assert overview.headers["padwatch-time"] == overview.json()["time"]
    advance(running)
    same = await ask(running, "overview", overview.headers["etag"])
    assert same.headers["padwatch-time"] == (await ask(running, "overview")).json()["time"]
    assert same.headers["padwatch-time"] > overview.headers["padwatch-time"]
    refused = await ask(running, "units/U9")
    assert refused.headers["padwatch-time"] == same.headers["padwatch-time"]


async def test_whatever_changes_is_news(running: Any, assessments: list[Assessment]) -> None:
    latest, spectrum = (f"units/U1/bearings/UJB/{what}" for what in ("latest", "spectrum"))
    trends = f"units/U1/bearings/UJB/trends?{RANGE}&quantity=speed_rpm"
    new = next(assessment for assessment in assessments if assessment.bearing == "UJB")
    later = replace(new, time_ns=assessments[-1].time_ns + 1_000_000_000)

    def alarm() -> None:
        running.alarms.link("U2", False, "no answer")
        running.clock.step(11_000_000_000)
        running.alarms.tick()

    changes: list[tuple[Callable[[], object], tuple[str, ...]]] = [
        (lambda: running.live.set_assessment(new), ("overview", spectrum)),
        (lambda: running.store.append([later], []), (trends,)),
        (lambda: setattr(running.live, "store_error", "disk full"), ("overview",)),
        (alarm, ("overview", "alarms")),
        (lambda: setattr(running.clock, "s", 30.5), ("overview", latest)),  # no longer current
        (
            lambda: running.live.set_link("U1", LinkState.NOT_CONNECTED, "no answer"),
            ("overview", "sources", "units", latest),
        ),
    ]
    for change, paths in changes:
        before = [(await ask(running, path)).headers["etag"] for path in paths]
        change()
        for path, tag in zip(paths, before, strict=True):
            assert (await ask(running, path, tag)).status_code == 200, path


async def test_ages_in_the_overview_are_those_of_now_also_in_parts_that_were_kept(
    running: Any,
) -> None:
    young = (await ask(running, "overview")).json()
    advance(running)
    old = (await ask(running, "overview")).json()
    for before, after in zip(young["units"], old["units"], strict=True):
        for one, other in zip(before["bearings"], after["bearings"], strict=True):
            if one["age_s"] is not None:
                assert other["age_s"] == one["age_s"] + JUMP_S
            assert {**other, "age_s": 0} == {**one, "age_s": 0}
    for unit in old["units"]:
        for shown in unit["bearings"]:
            path = f"units/{unit['id']}/bearings/{shown['bearing']}/latest"
            assert (await ask(running, path)).json() == shown
        assert (await ask(running, f"units/{unit['id']}")).json()["source"] == unit["source"]


async def test_every_answer_carries_its_origin_errors_and_pages_included(read_only: Any) -> None:
    for path in ("/api/v1/overview", "/api/v1/units/U9", "/livez", "/", "/nothing"):
        response = await read_only.get(path)
        assert response.headers["padwatch-origin"] == "live", path


async def test_a_tag_may_be_named_in_every_spelling(read_only: Any) -> None:
    tag = (await ask(read_only, "alarms")).headers["etag"]
    strong = tag.removeprefix("W/")
    for known in (tag, f'"other", {tag}', f'{tag},"other"', strong, "*"):
        assert (await ask(read_only, "alarms", known)).status_code == 304, known
    for unknown in ('"other"', "", ",,,", "W/", 'W/"', '"' * 4000):
        assert (await ask(read_only, "alarms", unknown)).status_code == 200, unknown
    refused = await ask(read_only, "units/U9", "*")
    assert refused.status_code == 404
    assert "etag" not in refused.headers


async def test_an_answer_for_all_does_not_end_with_the_client_that_asked_first(
    service: Any,
) -> None:
    alarms, askers = service.context.alarms, []

    def make() -> AlarmListModel:
        askers.append(ASKER.get())
        return alarm_list_model(alarms, service.films, Origin.LIVE, 0)

    shared = SharedAnswer(make, lambda: 0, service.clock)
    before = ASKER.set(Asker())
    await shared.answer()
    ASKER.reset(before)

    assert askers == [None]
