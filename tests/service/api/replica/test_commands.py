"""What people do at a replica is done once by the process that analyses, or not at all."""

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import httpx2
import pytest
from harness.waiting import at_work

from core.alarms.operation import Comment
from service.cluster.serving_side import WAIT_S, DatabaseSender
from service.live.commands import AlarmCommand, decoded, encoded
from service.live.snapshot import UnreadableError
from service.store.port import AlarmQuery
from service.store.sharing import Answer, Command, CommandState

LINK = "U1:link:link_lost"
ANNA = {"actor": "A. Name"}


@pytest.fixture
async def answered(pair: Any, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Any]:
    """The process that analyses looks for commands; there is time enough by the set clock."""
    monkeypatch.setattr("service.cluster.serving_side.WAIT_S", 1e12)
    monkeypatch.setattr("service.cluster.serving_side.EXPIRES_S", 1e9)
    async with at_work(pair.carrying_out.run()):
        yield pair


async def raise_alarm(pair: Any) -> None:
    pair.service.alarms.link("U1", False, "cut")
    pair.pass_time(3600.0)
    pair.service.alarms.tick()
    await pair.service.recorder.stored()
    await pair.told()


async def post(pair: Any, action: str, **body: object) -> httpx2.Response:
    answer: httpx2.Response = await pair.client.post(
        f"/api/v1/alarms/{LINK}/{action}", json={**ANNA, **body}
    )
    return answer


def ask_for_a_comment(pair: Any) -> Command:
    """Ask as a replica does, without waiting for an answer."""
    asking = DatabaseSender(pair.service.store, pair.service.clock)
    command = asking._command("U1", AlarmCommand(LINK, Comment("anna", "seen")), "anna")
    pair.service.store.commands.ask(command)
    return command


async def kill_after_commit(pair: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Kill the process that analyses before it answers a command, and let it look again."""
    with monkeypatch.context() as killed:
        killed.setattr(pair.service.store.commands, "answer", _killed_in)
        with pytest.raises(KeyboardInterrupt):
            await pair.carrying_out.look()
    await pair.carrying_out.look()
    await pair.carrying_out.look()


def changes(pair: Any) -> list[str]:
    events = pair.service.store.alarm_events(AlarmQuery(alarm=LINK))
    return [stored.event.change.value for stored in reversed(events)]


async def test_what_is_asked_rightly_reaches_the_engine_and_the_disk_and_is_shown(answered):
    await raise_alarm(answered)
    wrong = await post(answered, "acknowledge", occurrence=7)
    path = "/api/v1/alarms/U1:nothing:link_lost/acknowledge"
    unknown = await answered.client.post(path, json={**ANNA, "occurrence": 1})
    assert (wrong.status_code, unknown.status_code) == (409, 404)
    assert "check occurrence 1" in wrong.json()["detail"]
    assert not answered.service.alarms.alarm(LINK).is_acknowledged
    answer = await post(answered, "acknowledge", occurrence=1)

    assert answer.status_code == 200, answer.text
    assert answer.json()["state"] == "acknowledged"
    assert answered.service.alarms.alarm(LINK).is_acknowledged
    (event,) = answered.service.store.alarm_events(AlarmQuery(alarm=LINK, limit=1))
    assert (event.event.change.value, event.event.actor) == ("acknowledged", "A. Name")

    await post(answered, "shelve", duration_s=7200.0, reason="maintenance")
    await answered.replica.feed.look()  # before the next report
    assert (await answered.json(f"/api/v1/alarms/{LINK}"))["state"] == "shelved"


async def test_what_nobody_carries_out_is_said_and_not_carried_out_later(pair):
    await raise_alarm(pair)
    answer = await post(pair, "acknowledge", occurrence=1)

    assert answer.status_code == 503
    assert f"has not replied within {WAIT_S:g} s" in answer.json()["detail"]
    await pair.carrying_out.look()
    assert not pair.service.alarms.alarm(LINK).is_acknowledged


async def test_a_command_whose_asker_was_killed_is_not_carried_out_late(pair, monkeypatch):
    await raise_alarm(pair)
    monkeypatch.setattr(DatabaseSender, "_answer", _killed_in)
    with pytest.raises(KeyboardInterrupt):
        await post(pair, "acknowledge", occurrence=1)
    pair.pass_time(60.0)
    await pair.carrying_out.look()

    assert not pair.service.alarms.alarm(LINK).is_acknowledged
    assert pair.service.store.commands.open(["U1"]) == []


async def test_a_process_killed_before_its_commit_leaves_the_command_to_the_next(pair, monkeypatch):
    await raise_alarm(pair)
    command = ask_for_a_comment(pair)
    with monkeypatch.context() as killed:
        killed.setattr(pair.service.alarms, "operate", _killed_in)
        with pytest.raises(KeyboardInterrupt):
            await pair.carrying_out.look()
    assert pair.service.store.commands.look(command.id).state is CommandState.TAKEN

    await pair.carrying_out.look()
    assert changes(pair)[-1] == "commented"
    assert pair.service.store.commands.look(command.id).state is CommandState.DONE


def _killed_in(*_: object) -> None:
    raise KeyboardInterrupt


async def test_a_process_killed_after_its_commit_is_not_followed_by_a_second_time(
    pair, monkeypatch
):
    await raise_alarm(pair)
    command = ask_for_a_comment(pair)
    await kill_after_commit(pair, monkeypatch)

    assert changes(pair).count("commented") == 1
    assert pair.service.store.commands.look(command.id).state is CommandState.DONE


async def test_a_store_that_comes_back_late_is_told_of(pair, monkeypatch):
    await raise_alarm(pair)
    monkeypatch.setattr(pair.service.alarms, "_put", lambda _: None)
    monkeypatch.setattr(pair.service.recorder, "stored", _never)
    monkeypatch.setattr(DatabaseSender, "_give_up", _after(pair))
    monkeypatch.setattr("service.cluster.serving_side.EXPIRES_S", 1e6)  # time only steps here
    async with at_work(pair.carrying_out.run()):
        answer = await post(pair, "acknowledge", occurrence=1)

    assert answer.status_code == 503
    assert "not stored yet; check its result" in answer.json()["detail"]


def _after(pair: Any) -> Any:
    """Give up, but not before the command was taken."""
    give_up = DatabaseSender._give_up

    def late(self: DatabaseSender, command: Command, found: Answer) -> Answer:
        while not pair.service.store.commands.open(["U1"])[0].taken_by:
            pass
        return give_up(self, command, found)

    return late


async def _never() -> None:
    await asyncio.Event().wait()


def test_every_command_is_read_as_it_was_written():
    task = AlarmCommand(LINK, Comment("anna", "é\n\"'"))

    assert decoded(*encoded(task)) == task


def test_a_command_of_another_version_is_refused_by_both_versions():
    kind, document = encoded(AlarmCommand(LINK, Comment("anna", "seen")))
    own, fields = document.split("\n")

    with pytest.raises(UnreadableError, match=f"padwatch 0.0.9, but this is padwatch {own}"):
        decoded(kind, f"0.0.9\n{fields}")
