from dataclasses import replace

import pytest

from core.samples.gaps import Gap
from service.store.port import Store, StoreError, UnitGap
from service.store.positions_port import StreamPosition

HERE = StreamPosition("U1", "plant of today", 10, 3, b'{"a": 0.1}')


def test_a_position_is_kept_with_the_results_that_it_tells_of(store: Store) -> None:
    store.append([], [UnitGap("U1", Gap(1, 60, 60, 5))], positions=[HERE])
    assert store.position("U1") == HERE
    assert len(store.gaps("U1", 0, 10)) == 1


def test_the_newest_of_several_counts_until_the_stream_is_made_anew(store: Store) -> None:
    assert store.position("U1") is None
    later = replace(HERE, sequence=20, window_sequence=9, memory=b"x")
    store.append([], [], positions=[HERE, replace(HERE, unit="U2"), later])
    store.append([], [], positions=[HERE])
    assert store.position("U1") == later
    assert store.position("U2") == replace(HERE, unit="U2")
    anew = replace(HERE, stream="plant of tomorrow", sequence=1, window_sequence=1)
    store.append([], [], positions=[anew])
    assert store.position("U1") == anew


def test_what_is_not_stored_has_no_position_either(store: Store) -> None:
    wrong = UnitGap("U1", Gap(1, 60, -5, 5, None, "maybe"))  # type: ignore[arg-type]
    with pytest.raises((StoreError, ValueError, TypeError)):
        store.append([], [wrong], positions=[HERE])
    assert store.position("U1") is None
