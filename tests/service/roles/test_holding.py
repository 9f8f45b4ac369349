"""One process for each unit at a time."""

import asyncio
from pathlib import Path

import pytest

from acquisition.clock import SystemClock
from service.roles.holding import HoldLostError, Holds
from service.store.database import Hold
from service.store.sqlite import SqliteStore


async def test_a_second_process_stands_by_until_the_first_one_ends(tmp_path: Path) -> None:
    stores = [SqliteStore(tmp_path / "padwatch.sqlite3") for _ in range(2)]
    first, second = (Holds(store, ["U1", "U2"], SystemClock()) for store in stores)
    try:
        await first.take()
        assert first.waits_for is None
        first.require()
        waiting = asyncio.create_task(second.take())
        while second.waits_for in (None, "not begun"):
            await asyncio.sleep(0.01)
        assert "held by another padwatch" in (second.waits_for or "")
        assert not waiting.done()
        first.release()
        await asyncio.wait_for(waiting, 30.0)
        assert second.waits_for is None
    finally:
        first.release()
        second.release()
        for store in stores:
            store.close()


async def test_shares_that_overlap_take_all_their_units_or_none(tmp_path: Path) -> None:
    stores = [SqliteStore(tmp_path / "padwatch.sqlite3") for _ in range(3)]
    first, second, third = (
        Holds(store, units, SystemClock())
        for store, units in zip(stores, (["U2"], ["U1", "U2"], ["U1"]), strict=True)
    )
    try:
        await first.take()
        waiting = asyncio.create_task(second.take())
        while second.waits_for in (None, "not begun"):
            await asyncio.sleep(0.01)
        await asyncio.wait_for(third.take(), 30.0)  # U1 is not kept by who waits for U2
        waiting.cancel()
        await asyncio.wait([waiting])
    finally:
        for holds in (first, second, third):
            holds.release()
        for store in stores:
            store.close()


class Lost:
    """A name that is held no more."""

    is_held = False


async def test_who_has_lost_a_name_stops(tmp_path: Path) -> None:
    store = SqliteStore(tmp_path / "padwatch.sqlite3")
    holds = Holds(store, ["U1"], SystemClock())
    try:
        await holds.take()
        lost: Hold = Lost()
        holds._holds = [lost]
        with pytest.raises(HoldLostError, match="another process may have taken over"):
            holds.require()
    finally:
        holds.release()
        store.close()
