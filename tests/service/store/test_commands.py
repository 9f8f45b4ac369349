"""Commands of operators: answered once, and never taken up after they were withdrawn."""

from dataclasses import replace

import pytest

from core.alarms.alarm import Alarm, AlarmChange, AlarmIdentity, changed
from service.store.access.audit_entries import ActedNews
from service.store.sharing import DONE, KEPT_NS, Answer, Command, CommandState, OpenCommand
from service.store.sqlite import SqliteStore

COMMAND = Command("c1", "U1", "alarm", "{}", "vera", "10.0.0.9", 10**18, 10**18 + 10**10)
REFUSED = Answer(CommandState.REFUSED, "it does not fit")
NOW_NS = 10**18 + 1


def test_open_commands_are_read_as_they_were_asked_in_that_order_by_whoever_has_their_unit(
    store: SqliteStore,
) -> None:
    later = replace(COMMAND, id="a", asked_ns=COMMAND.asked_ns + 1)
    store.commands.ask(later)
    store.commands.ask(COMMAND)

    assert store.commands.open(["U1"]) == [OpenCommand(COMMAND, None), OpenCommand(later, None)]
    assert store.commands.open(["U2"]) == []
    assert store.commands.look("c1") == Answer(CommandState.WAITING, "")
    assert store.commands.look("c9") is None


def test_what_is_answered_stays_answered(store: SqliteStore) -> None:
    store.commands.ask(COMMAND)
    store.commands.answer("c1", REFUSED, NOW_NS)
    store.commands.answer("c1", DONE, NOW_NS)

    assert store.commands.look("c1") == REFUSED
    assert not store.commands.take("c1", "one")
    assert store.commands.open(["U1"]) == []


def test_a_withdrawn_command_is_not_taken_and_a_taken_one_not_withdrawn(store: SqliteStore) -> None:
    for id_ in ("c1", "c2"):
        store.commands.ask(replace(COMMAND, id=id_))

    assert store.commands.withdraw("c1", "nobody did it", NOW_NS)
    assert not store.commands.take("c1", "one")
    assert store.commands.look("c1") == Answer(CommandState.WITHDRAWN, "nobody did it")
    assert store.commands.take("c2", "one")
    assert not store.commands.withdraw("c2", "too late", NOW_NS)
    assert store.commands.open(["U1"]) == [OpenCommand(replace(COMMAND, id="c2"), "one")]


def test_a_command_is_answered_with_the_events_that_it_has_caused_or_not_at_all(
    store: SqliteStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    store.commands.ask(COMMAND)
    before = Alarm(AlarmIdentity("U1", "link", "link_lost"))
    after, event = changed(before, before, AlarmChange.COMMENTED, NOW_NS, "vera", "seen")
    news = ActedNews(after, (event,), "10.0.0.9", "c1")
    with monkeypatch.context() as broken:
        broken.setattr("service.store.alarms.answer_command", _fails)
        with pytest.raises(ZeroDivisionError):
            store.append([], [], [news])

    assert store.alarms() == []
    assert store.commands.look("c1") == Answer(CommandState.WAITING, "")
    store.append([], [], [news])
    assert [alarm.n_events for alarm in store.alarms()] == [1]
    assert store.commands.look("c1") == DONE


def _fails(*_: object) -> None:
    raise ZeroDivisionError


def test_commands_of_long_ago_are_forgotten(store: SqliteStore) -> None:
    store.commands.ask(COMMAND)
    store.commands.ask(replace(COMMAND, id="c2", asked_ns=COMMAND.asked_ns + KEPT_NS + 1))

    assert store.commands.look("c1") is None
    assert store.commands.look("c2") is not None
