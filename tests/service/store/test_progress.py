"""How far a unit is, and commands of operators: answered once, not taken up once withdrawn."""

from dataclasses import replace

import pytest
from rigs.assessments import assessment
from rigs.store_fixtures import at

from core.alarms.alarm import Alarm, AlarmChange, AlarmIdentity, changed
from core.samples.gaps import Gap, Reach
from service.store.access.audit_entries import ActedNews
from service.store.port import StoreError, UnitGap
from service.store.sharing import (
    DONE,
    KEPT_NS,
    Answer,
    Command,
    CommandState,
    OpenCommand,
    StreamPosition,
    UnitBeat,
    UnitRow,
)

HERE = StreamPosition("U1", "plant of today", 10, 3, b'{"a": 0.1}')


def test_a_position_is_kept_with_the_results_that_it_tells_of(store):
    store.append([], [UnitGap("U1", Gap(1, 60, 60, 5))], positions=[HERE])
    assert store.position("U1") == HERE
    assert len(store.gaps("U1", 0, 10)) == 1


def test_the_newest_of_several_counts_until_the_stream_is_made_anew(store):
    assert store.position("U1") is None
    later = replace(HERE, sequence=20, window_sequence=9, memory=b"x")
    store.append([], [], positions=[HERE, replace(HERE, unit="U2"), later])
    store.append([], [], positions=[HERE])
    assert store.position("U1") == later
    assert store.position("U2") == replace(HERE, unit="U2")
    anew = replace(HERE, stream="plant of tomorrow", sequence=1, window_sequence=1)
    store.append([], [], positions=[anew])
    assert store.position("U1") == anew


def test_what_is_not_stored_has_no_position_either(store):
    wrong = UnitGap("U1", Gap(1, 60, -5, 5, None, "maybe"))  # type: ignore[arg-type]
    with pytest.raises((StoreError, ValueError, TypeError)):
        store.append([], [wrong], positions=[HERE])
    assert store.position("U1") is None


def test_results_reach_as_far_as_the_newest_of_any_bearing(store):
    assert store.reach("U1") is None
    found = [assessment(at(n), speed_rpm=90.0) for n in range(3)]
    windows = [replace(a.window, epoch=7, stop_index=1000 * n + 1000) for n, a in enumerate(found)]
    results = [replace(a, window=w) for a, w in zip(found, windows, strict=True)]
    later = replace(results[2], bearing="TJB", time_ns=at(5))
    store.append([*results, replace(later, window=replace(windows[2], stop_index=9000))], [])
    store.append([replace(results[0], unit="U2", time_ns=at(9))], [])

    assert store.reach("U1") == Reach(7, 9000, at(5))


def test_gaps_behind_the_newest_result_are_known_as_they_were_recorded(store):
    found = assessment(at(1), speed_rpm=90.0)
    store.append([replace(found, window=replace(found.window, epoch=7, stop_index=1000))], [])
    behind = (
        Gap(7, 1000, 5, at(2), at(1)),
        Gap(7, 1000, 0, at(3), at(2), is_estimated=True),
        Gap(7, 1100, 5, at(4)),
    )
    others = (Gap(7, 900, 10, at(0)), Gap(8, 1000, 10, at(5)))
    store.append([], [UnitGap("U1", gap) for gap in (*behind, *others)])
    store.append([], [UnitGap("U2", Gap(7, 2000, 10, at(6)))])

    store.append([], [UnitGap("U1", behind[1])])  # as two starts record the same outage
    reach = store.reach("U1")

    assert set(reach.gaps) == set(behind)
    found_gaps = store.gaps("U1", 0, 2**62)
    assert (set(found_gaps), len(found_gaps)) == ({*behind, *others}, 5)


REPORT = UnitRow("U1", 1, 10**18, "signs", 7, b"state")


def test_a_report_is_read_as_it_was_written_and_a_beat_leaves_the_state(store):
    store.unit_states.report("one", [REPORT])

    assert store.unit_states.beats() == [UnitBeat("U1", "one", 1, 10**18, "signs", 7)]
    assert store.unit_states.states(["U1", "U9"]) == {"U1": ("one", 7, b"state")}
    store.unit_states.report("one", [replace(REPORT, n_beats=2, signs="newer", state=None)])
    assert store.unit_states.beats() == [UnitBeat("U1", "one", 2, 10**18, "newer", 7)]
    assert store.unit_states.states(["U1"]) == {"U1": ("one", 7, b"state")}


@pytest.mark.parametrize("change", [{"revision": 8}, {"unit": "U2"}])
def test_a_beat_is_not_written_over_a_state_that_it_is_not_of(store, change):
    store.unit_states.report("one", [REPORT])
    store.unit_states.report("one", [replace(REPORT, n_beats=2, state=None, **change)])  # type: ignore[arg-type]

    assert [beat.n_beats for beat in store.unit_states.beats()] == [1]


def test_a_process_that_lost_its_unit_does_not_keep_the_state_of_its_successor_alive(store):
    store.unit_states.report("one", [REPORT])
    store.unit_states.report("two", [replace(REPORT, state=b"other")])
    store.unit_states.report("one", [replace(REPORT, n_beats=9, state=None)])

    assert [(beat.process, beat.n_beats) for beat in store.unit_states.beats()] == [("two", 1)]
    assert store.unit_states.states(["U1"]) == {"U1": ("two", 7, b"other")}


COMMAND = Command("c1", "U1", "alarm", "{}", "vera", "10.0.0.9", 10**18, 10**18 + 10**10)
REFUSED = Answer(CommandState.REFUSED, "it does not fit")
NOW_NS = 10**18 + 1


def test_open_commands_are_read_as_they_were_asked_in_that_order_by_whoever_has_their_unit(store):
    later = replace(COMMAND, id="a", asked_ns=COMMAND.asked_ns + 1)
    store.commands.ask(later)
    store.commands.ask(COMMAND)

    assert store.commands.open(["U1"]) == [OpenCommand(COMMAND, None), OpenCommand(later, None)]
    assert store.commands.open(["U2"]) == []
    assert store.commands.look("c1") == Answer(CommandState.WAITING, "")
    assert store.commands.look("c9") is None


def test_what_is_answered_stays_answered(store):
    store.commands.ask(COMMAND)
    store.commands.answer("c1", REFUSED, NOW_NS)
    store.commands.answer("c1", DONE, NOW_NS)

    assert store.commands.look("c1") == REFUSED
    assert not store.commands.take("c1", "one")
    assert store.commands.open(["U1"]) == []


def test_a_withdrawn_command_is_not_taken_and_a_taken_one_not_withdrawn(store):
    for id_ in ("c1", "c2"):
        store.commands.ask(replace(COMMAND, id=id_))

    assert store.commands.withdraw("c1", "nobody did it", NOW_NS)
    assert not store.commands.take("c1", "one")
    assert store.commands.look("c1") == Answer(CommandState.WITHDRAWN, "nobody did it")
    assert store.commands.take("c2", "one")
    assert not store.commands.withdraw("c2", "too late", NOW_NS)
    assert store.commands.open(["U1"]) == [OpenCommand(replace(COMMAND, id="c2"), "one")]


def test_a_command_is_answered_with_the_events_that_it_has_caused_or_not_at_all(store, monkeypatch):
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


def test_commands_of_long_ago_are_forgotten(store):
    store.commands.ask(COMMAND)
    store.commands.ask(replace(COMMAND, id="c2", asked_ns=COMMAND.asked_ns + KEPT_NS + 1))

    assert store.commands.look("c1") is None
    assert store.commands.look("c2") is not None
