"""What is asked wrongly of alarms, or while nothing can be stored, is refused and not done."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import pytest
from rigs.probes import ACKNOWLEDGE, ALARMS, ANNA, SHELVE, Probes, post

from core.quality import Reason
from service.measuring import commands as in_process

WRONG_BODIES: list[tuple[str, Any, str]] = [
    (ACKNOWLEDGE, {"actor": "A. Name"}, "occurrence"),
    (ACKNOWLEDGE, {"actor": "", "occurrence": 1}, "actor"),
    (ACKNOWLEDGE, {"actor": "A\nName", "occurrence": 1}, "actor"),
    (ACKNOWLEDGE, {"actor": "A" * 81, "occurrence": 1}, "actor"),
    (ACKNOWLEDGE, {"actor": "A. Name", "occurrence": "1"}, "occurrence"),
    (ACKNOWLEDGE, {"actor": "A. Name", "occurrence": 0}, "occurrence"),
    (ACKNOWLEDGE, {"actor": "A. Name", "occurrence": 1, "force": True}, "force"),
    (SHELVE, {"actor": "A. Name", "duration_s": 60.0}, "reason"),
    (SHELVE, {"actor": "A. Name", "reason": "x", "duration_s": 0.0}, "duration_s"),
    (SHELVE, {"actor": "A. Name", "reason": "x", "duration_s": 7201.0}, "duration_s"),
    (SHELVE, {"actor": "A. Name", "reason": "x", "duration_s": "1 h"}, "duration_s"),
]


async def test_what_is_asked_wrongly_is_named_and_changes_nothing(
    service: Any, probes: Probes
) -> None:
    probes.send(3, Reason.SENSOR_FAILURE)
    before = await service.json(ALARMS)

    for path, body, named in WRONG_BODIES:
        problem = await service.refused(path, 422, body)

        assert [mistake["parameter"] for mistake in problem["errors"]] == [named]
        assert (await service.json(ALARMS))["alarms"] == before["alarms"]
    # a form of another page is no request either
    text, plain = '{"actor": "A. Name", "occurrence": 1}', {"Content-Type": "text/plain"}
    form = await service.client.post(ACKNOWLEDGE, content=text, headers=plain)
    assert form.status_code == 422


async def test_an_unknown_alarm_is_not_found(read_only: Any) -> None:
    for alarm in ("U1:nothing:channel_not_ok", "U9:x:y", "%00", "U1", ":::"):
        problem = await read_only.refused(f"{ALARMS}/{alarm}/unshelve", 404, ANNA)
        assert problem["title"] == "Unknown alarm"
    for alarm in ("U1:nothing:link_lost", "U9:link:link_lost", "plant:store:results_lost", "x"):
        assert alarm in (await read_only.problem(f"{ALARMS}/{alarm}", 404))["detail"]


async def test_a_wrong_question_is_refused_by_name(read_only: Any) -> None:
    for wanted, named in (
        ({"kind": "earthquake"}, "kind"),
        ({"limit": 0}, "limit"),
        ({"limit": 1001}, "limit"),
        ({"before": 0}, "before"),
        ({"start": "2026-01-02T00:00:00Z", "end": "2026-01-01T00:00:00Z"}, "start"),
    ):
        problem = await read_only.problem(f"{ALARMS}/events", 422, **wanted)
        assert problem["errors"][0]["parameter"] == named


@contextmanager
def refusing(service: Any, table: str) -> Iterator[None]:
    """Let the database refuse new rows of a table, as a full disk does."""
    with closing(sqlite3.connect(service.store._path)) as connection:
        connection.execute(
            f"CREATE TRIGGER no BEFORE INSERT ON {table} BEGIN SELECT RAISE(ABORT, 'full'); END"
        )
        yield
        connection.execute("DROP TRIGGER no")


@pytest.mark.parametrize(
    ("table", "title"),
    [("high_water", "Action not applied"), ("alarm_event", "Not stored yet")],
)
async def test_an_acknowledgement_that_cannot_be_stored_is_refused_and_may_be_repeated(
    service: Any, probes: Probes, monkeypatch: pytest.MonkeyPatch, table: str, title: str
) -> None:
    body = {**ANNA, "occurrence": 1}
    probes.send(3, Reason.SENSOR_FAILURE)
    await probes.stored()
    with refusing(service, table), monkeypatch.context() as impatient:
        impatient.setattr(in_process, "STORED_WITHIN_S", 0.05)
        assert (await service.refused(ACKNOWLEDGE, 503, body))["title"] == title
        assert not service.store.alarms()[0].is_acknowledged
    if table == "high_water":
        (alarm,) = (await service.json(ALARMS))["alarms"]
        assert (alarm["state"], alarm["is_acknowledged"]) == ("unacknowledged", False)
    assert (await post(service, ACKNOWLEDGE, body)).status_code == 200
    assert service.store.alarms()[0].is_acknowledged


async def test_nothing_is_acknowledged_while_the_database_file_is_gone(
    service: Any, probes: Probes
) -> None:
    body = {**ANNA, "occurrence": 1}
    probes.send(3, Reason.SENSOR_FAILURE)
    await probes.stored()
    path = service.store._path
    aside = path.rename(path.with_name("aside"))

    problem = await service.refused(ACKNOWLEDGE, 503, body)

    assert problem["title"] == "Action not applied"
    assert "the database file was removed while padwatch runs" in problem["detail"]
    aside.rename(path)
    assert (await post(service, ACKNOWLEDGE, body)).status_code == 200
    assert service.store.alarms()[0].is_acknowledged
