"""Reference vectors of 1× in the store: the newest of each state rules, none is changed."""

from pathlib import Path

import pytest

from core.alarms.vector_change import OrderVector, VectorReference
from core.condition.operating_state import OperatingState
from service.store.port import StoreError
from service.store.sqlite import SqliteStore
from service.store.vector_reference_port import SetVectorReference

FULL, PART = OperatingState.FULL_LOAD, OperatingState.PART_LOAD


def reference(set_ns: int, state: OperatingState, amplitude: float) -> SetVectorReference:
    vectors = {"shaft_x": OrderVector(amplitude, 135.0), "bearing_y": OrderVector(20.0)}
    found = VectorReference("U1", "UJB", state, vectors)
    return SetVectorReference(found, set_ns, "E. Name", "after balancing")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "padwatch.sqlite3"


def test_the_newest_of_each_operating_state_rules_also_after_a_restart(path: Path) -> None:
    first, other, newest = (
        reference(3, FULL, 60.0),
        reference(2, PART, 90.0),
        reference(1, FULL, 50),
    )
    store = SqliteStore(path)
    for each in (first, other, newest):  # by order of setting: a clock may be put back
        store.order1_references.add(each)
    store.close()

    again = SqliteStore(path)
    assert again.order1_references.in_force() == [other, newest]
    assert again.order1_references.history("U1", "UJB") == [newest, other, first]
    assert again.order1_references.history("U1", "TJB") == []
    again.close()


@pytest.mark.parametrize("vectors", ['{"shaft_x": [-1.0, null]}', '{"shaft_x": 7}'])
def test_a_reference_that_makes_no_sense_is_named(path: Path, vectors: str) -> None:
    store = SqliteStore(path)
    store._writer.execute(
        "INSERT INTO vector_reference (unit, bearing, state, set_ns, author, note, vectors)"
        " VALUES ('U1', 'UJB', 5, 1, 'x', '', ?)",
        (vectors,),
    )
    with pytest.raises(StoreError, match="1× reference of unit U1 bearing UJB"):
        store.order1_references.in_force()
    store.close()
