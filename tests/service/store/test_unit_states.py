"""Reports on units: the newest of each counts, and a state stays until there is another."""

from dataclasses import replace

import pytest

from service.store.sqlite import SqliteStore
from service.store.unit_states_port import UnitBeat, UnitReport

REPORT = UnitReport("U1", 1, 10**18, "connected", None, 10**18, "signs", 7, b"state")


def test_a_report_is_read_as_it_was_written_and_a_beat_leaves_the_state(store: SqliteStore) -> None:
    store.unit_states.report("one", [REPORT])

    assert store.unit_states.beats() == [UnitBeat("U1", "one", 1, 10**18, "signs", 7)]
    assert store.unit_states.states(["U1", "U9"]) == {"U1": ("one", 7, b"state")}
    store.unit_states.report("one", [replace(REPORT, n_beats=2, signs="newer", state=None)])
    assert store.unit_states.beats() == [UnitBeat("U1", "one", 2, 10**18, "newer", 7)]
    assert store.unit_states.states(["U1"]) == {"U1": ("one", 7, b"state")}


@pytest.mark.parametrize("change", [{"revision": 8}, {"unit": "U2"}])
def test_a_beat_is_not_written_over_a_state_that_it_is_not_of(
    store: SqliteStore, change: dict[str, object]
) -> None:
    store.unit_states.report("one", [REPORT])
    store.unit_states.report("one", [replace(REPORT, n_beats=2, state=None, **change)])  # type: ignore[arg-type]

    assert [beat.n_beats for beat in store.unit_states.beats()] == [1]


def test_a_process_that_lost_its_unit_does_not_keep_the_state_of_its_successor_alive(
    store: SqliteStore,
) -> None:
    store.unit_states.report("one", [REPORT])
    store.unit_states.report("two", [replace(REPORT, state=b"other")])
    store.unit_states.report("one", [replace(REPORT, n_beats=9, state=None)])

    assert [(beat.process, beat.n_beats) for beat in store.unit_states.beats()] == [("two", 1)]
    assert store.unit_states.states(["U1"]) == {"U1": ("two", 7, b"other")}
