"""A replica answers as the process that analyses, and never shows the dead as alive."""

from typing import Any

import pytest

from core.alarms.alarm import AlarmState
from core.limits import AlarmLevel
from service.app.replica_process import Replica
from service.live.current_state import NOT_ANALYSED, SILENT_AFTER_S
from service.live.status import LinkState
from service.store.port import StoreError

SAME = [
    "/api/v1/overview",
    "/api/v1/units",
    "/api/v1/units/U1/bearings",
    "/api/v1/units/U1/bearings/UJB/latest",
    "/api/v1/units/U2/bearings/UJB/latest",
    "/api/v1/units/U1/bearings/UJB/budgets/dynamic_k_xx_n_per_m",
    "/api/v1/units/U1/bearings/UJB/film",
    "/api/v1/alarms",
    "/api/v1/alarms/U1:link:link_lost",
    "/api/v1/alarms/plant:store:results_not_stored",
    "/api/v1/delivery",
]
LINK = "U1:link:link_lost"
ELSEWHERE = {"captures_error", "refresh_s", "revision"}
"""Of the overview: what lies with the process that analyses, and what the test rounds."""


async def test_a_replica_answers_as_the_process_that_analyses(pair):
    for path in SAME:
        mine, theirs = await pair.client.get(path), await pair.service.client.get(path)

        assert mine.status_code == theirs.status_code, path
        assert _shared(mine.json()) == _shared(theirs.json()), path


def _shared(answer: Any) -> Any:
    if isinstance(answer, dict) and "captures_error" in answer:
        return {key: value for key, value in answer.items() if key not in ELSEWHERE}
    if isinstance(answer, dict) and "status" in answer:
        return answer["status"]
    return answer


async def test_a_process_that_has_died_is_not_shown_as_healthy(pair):
    before = pair.replica.live.alarms.revision
    pair.service.clock.s += SILENT_AFTER_S + 0.1
    assert pair.replica.live.alarms.revision != before  # alarms are looked at anew at once
    await pair.replica.feed.look()

    latest = await pair.json("/api/v1/units/U1/bearings/UJB/latest")
    unit = await pair.json("/api/v1/units/U1")
    alarms = await pair.json("/api/v1/alarms")
    assert latest["quality"] == {"level": "bad", "reason": "not_connected"}
    assert {reading["value"] for reading in latest["readings"].values()} == {None}
    assert (unit["source"]["state"], unit["source"]["reason"]) == ("not_connected", NOT_ANALYSED)
    known = {a["id"] for a in alarms["alarms"] if a["condition"] != "unknown"}
    assert known == set()
    assert {a["id"] for a in alarms["unjudged"]} >= {"U1:link:link_lost"}


async def test_a_report_that_was_there_before_the_replica_is_no_sign_of_life(running, pair, plant):
    await pair.reporter.report()
    late = Replica(plant, running.store, running.clock)
    await late.feed.start()
    await late.feed.look()
    assert not late.live.units.is_alive("U1")
    assert not late.live.units.current("U1", "UJB").is_current

    await pair.reporter.report()
    await late.feed.look()
    assert late.live.units.is_alive("U1")
    assert late.live.units.current("U1", "UJB").is_current


async def test_what_stands_still_grows_old_whatever_the_clock_of_another_host_shows(pair):
    pair.service.clock.ns -= 3600 * 10**9
    await pair.told()
    assert pair.replica.live.units.is_alive("U1")
    assert pair.replica.live.units.current("U1", "UJB").is_current
    for _ in range(20):
        pair.service.clock.s += 4.0
        await pair.told()

    latest = await pair.json("/api/v1/units/U1/bearings/UJB/latest")
    assert latest["quality"]["reason"] == "stale"
    assert pair.replica.live.units.current("U1", "UJB").age_s == pytest.approx(80.0)
    pair.service.live.set_link("U1", LinkState.NOT_CONNECTED, "cut")
    await pair.told()
    source = (await pair.json("/api/v1/units/U1"))["source"]
    assert (source["state"], source["reason"]) == ("not_connected", "cut")


async def test_ages_go_on_between_reports_and_live_samples_stay_where_they_are(pair):
    before = await pair.json("/api/v1/units/U1/bearings/UJB/latest")
    age_s = pair.replica.live.units.current("U1", "UJB").age_s
    pair.service.clock.s += 3.0
    assert pair.replica.live.units.current("U1", "UJB").age_s == pytest.approx(age_s + 3.0)
    assert await pair.json("/api/v1/units/U1/bearings/UJB/latest") == before
    for path in ("bearings/UJB/spectrum", "bearings/UJB/motion", "waveform"):
        answer = await pair.client.get(f"/api/v1/units/U1/{path}")

        assert answer.status_code == 409, path
        assert "exist only in the process that analyses it" in answer.json()["detail"]


async def test_readiness_and_metrics_say_who_analyses(pair):
    text = (await pair.client.get("/metrics")).text
    assert 'padwatch_unit_analysed{unit="U1"} 1.0' in text
    assert 'padwatch_store_info{kind="' in text
    assert 'padwatch_bearings{quality="good",unit="U1"}' in text
    assert 'padwatch_eccentricity_ratio{bearing="UJB",quality="good",unit="U1"}' in text
    assert 'padwatch_film_stiffness_newtons_per_meter{bearing="UJB",direction="x"' in text

    alive = (await pair.client.get("/readyz")).json()["checks"]
    pair.service.clock.s += 60.0
    answer = await pair.client.get("/readyz")

    assert alive["analysis of U1"] == "last heartbeat 0.0 s ago"
    assert answer.status_code == 200  # others may go on; the replica does what it can
    assert answer.json()["checks"]["analysis of U1"] == "silent: last heartbeat 60.0 s ago"


async def test_a_report_of_another_version_is_no_sign_of_life(pair, monkeypatch):
    pair.service.clock.s += SILENT_AFTER_S + 0.1
    monkeypatch.setattr(
        "service.cluster.measuring_side.link_document", lambda _: '[{"version": 9}]'
    )
    await pair.told()

    assert not pair.replica.live.units.is_alive("U1")


@pytest.mark.parametrize("is_written", [True, False])
async def test_what_follows_a_report_whose_fate_nobody_knew_is_shown(pair, monkeypatch, is_written):
    stored, alarms = pair.service.store.unit_states, pair.service.alarms
    write = stored.report

    def without_an_answer(*told: Any) -> None:
        if is_written:
            write(*told)
        raise StoreError("the answer got lost")

    alarms.link("U1", True)
    alarms.link("U1", False, "cut")
    pair.pass_time(20.0)
    alarms.tick()
    with monkeypatch.context() as patched:
        patched.setattr(stored, "report", without_an_answer)
        await pair.told()
    assert pair.replica.live.alarms.alarm(LINK).level is (AlarmLevel.ALERT if is_written else None)

    alarms.link("U1", True)
    await pair.told()
    shown = pair.replica.live.alarms.alarm(LINK)
    assert (shown.level, shown.state) == (None, AlarmState.RETURNED_UNACKNOWLEDGED)
