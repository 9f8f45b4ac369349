"""No read goes on for nobody, and none hands out without limit."""

import pytest

from service.asker import ASKER, Asker
from service.store import sql_store
from service.store.port import QueryTooLargeError, StoreError
from service.store.sqlite import SqliteStore, readers


def test_a_read_ends_when_its_asker_has_gone(store: SqliteStore, query, monkeypatch) -> None:
    monkeypatch.setattr(readers, "LOOK_AFTER_STEPS", 1)
    asker = Asker()
    before = ASKER.set(asker)
    try:
        assert store.trend(query()).time_ns == []

        asker.has_gone = True

        with pytest.raises(StoreError, match="interrupted"):
            store.trend(query())
    finally:
        ASKER.reset(before)
    assert store.trend(query()).time_ns == []


def test_more_gaps_than_anybody_reads_are_refused(store: SqliteStore, gap, monkeypatch) -> None:
    monkeypatch.setattr(sql_store, "MAX_GAPS", 2)
    store.append([], [gap(stop_ns, first_index=stop_ns) for stop_ns in (1, 2, 3)])

    assert len(store.gaps("U1", 0, 3)) == 2
    with pytest.raises(QueryTooLargeError, match="more than 2 gaps"):
        store.gaps("U1", 0, 4)
