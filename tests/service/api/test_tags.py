"""Answers have tags: who has seen one already is told that nothing is new, and only then."""

import asyncio
import math
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import httpx2
from starlette.requests import Request

from service.api.answers import Answers, json_of
from service.api.server import SECURITY_HEADERS, AddedHeaders
from service.live.status import LinkState
from service.runtime.asker import ASKER
from service.runtime.times import rfc3339

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
    "units/U1/bearings/UJB/baselines",
    f"units/U1/bearings/UJB/trends?{RANGE}&quantity=speed_rpm",
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


async def test_who_has_an_answer_already_is_not_sent_it_again(running):
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
    assert overview.headers["padwatch-time"] == rfc3339(running.clock.now_ns())
    advance(running)
    same = await ask(running, "overview", overview.headers["etag"])
    assert same.headers["padwatch-time"] == rfc3339(running.clock.now_ns())
    assert same.headers["padwatch-time"] > overview.headers["padwatch-time"]
    refused = await ask(running, "units/U9")
    assert refused.headers["padwatch-time"] == same.headers["padwatch-time"]


async def test_whatever_changes_is_news(running, assessments):
    latest, spectrum = (f"units/U1/bearings/UJB/{what}" for what in ("latest", "spectrum"))
    trends = f"units/U1/bearings/UJB/trends?{RANGE}&quantity=speed_rpm"
    new = next(assessment for assessment in assessments if assessment.bearing == "UJB")
    later = replace(new, time_ns=assessments[-1].time_ns + 1_000_000_000)

    def alarm() -> None:
        running.alarms.link("U2", False, "no answer")
        running.clock.step(11_000_000_000)
        running.alarms.tick()

    def store() -> None:
        running.store.append([later], [])
        running.live.note_stored([later])

    changes: list[tuple[Callable[[], object], tuple[str, ...]]] = [
        (lambda: running.live.set_assessment(new), ("overview", spectrum)),
        (store, (trends,)),
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


async def test_an_answer_is_repeated_for_the_same_caller_and_host_until_it_changes(running):
    """A repeated answer is the first one; all others pass through the whole application."""
    routed, added = [], [*SECURITY_HEADERS, ("padwatch-origin", "live")]
    complete = AddedHeaders(running.app, added)

    async def noted(scope: Any, *channels: Any) -> None:
        routed.append(scope["path"])
        await complete(scope, *channels)

    app = running.app.repeating(noted, added)

    async def ask(path: str, host: str = "localhost", **options: Any) -> tuple[int, Any]:
        before = len(routed)
        transport = httpx2.ASGITransport(app, client=options.pop("client", ("127.0.0.1", 1)))
        async with httpx2.AsyncClient(transport=transport, base_url=f"http://{host}") as client:
            answer = await client.request("GET", f"/api/v1/{path}", **options)
        return len(routed) - before, answer

    for path in ("overview", "alarms", "units/U1/bearings/UJB/latest"):
        (_, first), (n_routed, again) = await ask(path), await ask(path)
        assert (n_routed, again.status_code, again.content) == (0, 200, first.content), path
        assert sorted(again.headers.raw) == sorted(first.headers.raw)
        known = {"If-None-Match": first.headers["etag"]}
        _, same = await ask(path, headers=known | {"Accept": "*/*;q=0.5"})
        n_routed, repeated = await ask(path, headers=known)
        assert (n_routed, repeated.status_code, same.status_code) == (0, 304, 304)
        assert sorted(repeated.headers.raw) == sorted(same.headers.raw)

    for others in (
        {"host": "127.0.0.1"},
        {"content": b"{}"},
        {"client": ("10.0.0.9", 1)},
        {"headers": {"X-Forwarded-For": "10.0.0.9"}},
        {"headers": {"Authorization": "Bearer pw_x"}},
    ):
        assert (await ask("overview", **others))[0] == 1, others
    running.live.set_link("U1", LinkState.NOT_CONNECTED, "no answer")
    await running.client.get("/livez")  # takes the report of measuring
    n_routed, news = await ask("overview")
    assert n_routed == 1
    assert "no answer" in news.text


async def test_the_last_hours_are_others_later(running):
    path = "units/U1/bearings/UJB/trends?last=1h&quantity=speed_rpm"
    tag = (await ask(running, path)).headers["etag"]
    assert (await ask(running, path, tag)).status_code == 304
    running.clock.step(61_000_000_000)  # beyond the minute that the range is rounded to
    assert (await ask(running, path, tag)).status_code == 200


async def test_an_answer_is_the_same_while_only_time_passes(running):
    before = {path: (await ask(running, path)).json() for path in POLLED}
    advance(running)
    running.context.answers.started = "0a1b2c3d"  # as after a restart of the service
    for path, known in before.items():
        now = (await ask(running, path)).json()
        if path == "overview":
            assert now.pop("revision") != known.pop("revision")
        if not path.endswith("baselines"):  # the progress of learning counts the last days
            assert now == known, path


async def test_a_range_in_the_past_is_not_read_again_for_new_results(running, assessments):
    path = "units/U1/bearings/UJB/trends?quantity=speed_rpm"
    closed = f"{path}&start=2026-01-01T00:00:00Z&end=2026-01-01T00:00:20Z"
    running.live.note_stored(assessments)
    tags = [(await ask(running, one)).headers["etag"] for one in (closed, f"{path}&{RANGE}")]

    last = max(assessments, key=lambda one: one.time_ns)
    later = replace(last, time_ns=last.time_ns + 1_000_000_000)
    running.recorder.put([later])
    await running.recorder.settled()

    assert (await ask(running, closed, tags[0])).status_code == 304
    assert (await ask(running, f"{path}&{RANGE}", tags[1])).status_code == 200


async def test_a_known_answer_is_confirmed_without_the_store_and_without_building_it(running):
    paths = [path for path in POLLED if "trends" in path or path.endswith(("latest", "spectra"))]
    tags = {path: (await ask(running, path)).headers["etag"] for path in paths}
    running.store.close()
    for path, tag in tags.items():
        assert (await ask(running, path, tag)).status_code == 304
        assert (await ask(running, path)).status_code == 200, "the cache needs no store either"


async def test_later_polls_of_the_overview_list_only_the_units_that_changed(running, assessments):
    whole = (await ask(running, "overview")).json()
    assert [unit["id"] for unit in whole["units"]] == ["U1", "U2"]
    assert whole["since"] is None
    since = f"overview?since={whole['revision']}"
    none = (await ask(running, since)).json()
    assert (none["units"], none["since"]) == ([], whole["revision"])

    running.live.set_assessment(assessments[0])
    changed = (await ask(running, since)).json()

    assert [unit["id"] for unit in changed["units"]] == ["U1"]
    assert changed["revision"] != whole["revision"]
    for unknown in ("0-1", "x", f"{whole['revision']}9", "-"):
        other = (await ask(running, f"overview?since={unknown}")).json()
        assert len(other["units"]) == (0 if unknown.endswith("9") else 2), unknown


async def test_a_tag_may_be_named_in_every_spelling(read_only):
    tag = (await ask(read_only, "alarms")).headers["etag"]
    strong = tag.removeprefix("W/")
    for known in (tag, f'"other", {tag}', f'{tag},"other"', strong, "*"):
        assert (await ask(read_only, "alarms", known)).status_code == 304, known
    for unknown in ('"other"', "", ",,,", "W/", 'W/"', '"' * 4000):
        assert (await ask(read_only, "alarms", unknown)).status_code == 200, unknown
    refused = await ask(read_only, "units/U9", "*")
    assert refused.status_code == 404
    assert "etag" not in refused.headers


def request(encoding: str = "", path: str = "/api/v1/x") -> Request:
    headers = [(b"accept-encoding", encoding.encode())]
    return Request({"type": "http", "path": path, "query_string": b"", "headers": headers})


async def test_many_clients_wait_for_one_answer_that_ends_with_the_last_of_them():
    answers, askers, goes_on = Answers(), [], threading.Event()

    def make() -> dict[str, Any]:
        asker = ASKER.get()
        assert asker is not None
        askers.append(asker)
        goes_on.wait(30)
        return {"gone": asker.has_gone}

    first, second = (asyncio.create_task(answers.of(request(), lambda: 1, make)) for _ in range(2))
    while not askers:
        await asyncio.sleep(0.001)
    first.cancel()
    await asyncio.wait([first])
    assert not askers[0].has_gone
    goes_on.set()
    assert (await second).body == b'{"gone":false}'
    assert len(askers) == 1
    assert (await answers.of(request(), lambda: 1, make)).body == b'{"gone":false}'
    assert len(askers) == 1

    goes_on.clear()
    alone = asyncio.create_task(answers.of(request(), lambda: 2, make))
    while len(askers) == 1:
        await asyncio.sleep(0.001)
    alone.cancel()
    await asyncio.wait([alone])
    assert askers[1].has_gone
    later = asyncio.create_task(answers.of(request(), lambda: 2, make))
    while len(askers) == 2:
        await asyncio.sleep(0.001)
    goes_on.set()
    assert (await later).body == b'{"gone":false}'


async def test_large_answers_are_compressed_as_the_client_accepts(read_only):
    whole = await ask(read_only, "units/U1/bearings/UJB/spectrum")
    for accepted, encoding in (
        ("zstd, gzip", "zstd"),
        ("gzip;q=0.5, br", "gzip"),
        ("zstd;q=0, gzip", "gzip"),
        ("br", None),
        ("zstd;q=0.0", None),
    ):
        for path in ("units/U1/bearings/UJB/spectrum", "quantities"):
            headers = {"Accept-Encoding": accepted}
            answer = await read_only.client.get(f"/api/v1/{path}", headers=headers)
            assert answer.headers.get("content-encoding") == encoding, (path, accepted)
            assert "Accept-Encoding" in answer.headers["vary"]
    assert whole.json()["frequency_hz"]
    small = await read_only.client.get("/livez", headers={"Accept-Encoding": "zstd"})
    assert "content-encoding" not in small.headers


def test_the_cache_forgets_the_answers_used_longest_ago():
    async def fill() -> list[int]:
        answers, made = Answers(max_bytes=100), []

        def make(n: int) -> dict[str, Any]:
            made.append(n)
            return {"text": "x" * 30}

        for n in (1, 2, 1, 3, 1, 2):
            await answers.of(request(), lambda n=n: n, lambda n=n: make(n))
        return made

    assert asyncio.run(fill()) == [1, 2, 3, 2]


def test_what_is_no_number_is_null_in_every_kind_of_answer():
    assert (
        json_of({"values": [1.0, math.nan, None, -math.inf]}) == b'{"values":[1.0,null,null,null]}'
    )
