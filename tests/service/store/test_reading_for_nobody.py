"""A read that nobody waits for any more is given up."""

import pytest

from service.asker import ASKER, Asker
from service.store import sqlite
from service.store.port import StoreError
from service.store.sqlite import SqliteStore


def test_a_read_ends_when_its_asker_has_gone(store: SqliteStore, query, monkeypatch) -> None:
    monkeypatch.setattr(sqlite, "LOOK_AFTER_STEPS", 1)
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
