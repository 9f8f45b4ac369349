"""One process for each unit at a time."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from acquisition.clock import SystemClock
from service.roles.holding import HoldLostError, Holds
from service.store.database import Hold
from service.store.sqlite import SqliteStore

Begin = Callable[..., Holds]


@pytest.fixture
def begin(tmp_path: Path) -> Iterator[Begin]:
    """Begins processes that want to hold units of one plant; they let go at the end."""
    with ExitStack() as stack:

        def process(*units: str) -> Holds:
            store = stack.enter_context(closing(SqliteStore(tmp_path / "padwatch.sqlite3")))
            holds = Holds(store, list(units), SystemClock())
            stack.callback(holds.release)
            return holds

        yield process


async def waiting(holds: Holds) -> "asyncio.Task[None]":
    """Let a process wait for its units."""
    taking = asyncio.create_task(holds.take())
    while holds.waits_for in (None, "not begun"):
        await asyncio.sleep(0.01)
    return taking


async def test_a_second_process_stands_by_until_the_first_one_ends(begin: Begin) -> None:
    first, second = begin("U1", "U2"), begin("U1", "U2")
    await first.take()
    assert first.waits_for is None
    first.require()
    taking = await waiting(second)
    assert "held by another padwatch" in (second.waits_for or "")
    assert not taking.done()
    first.release()
    await asyncio.wait_for(taking, 30.0)
    assert second.waits_for is None


async def test_shares_that_overlap_take_all_their_units_or_none(begin: Begin) -> None:
    first, second, third = begin("U2"), begin("U1", "U2"), begin("U1")
    await first.take()
    taking = await waiting(second)
    await asyncio.wait_for(third.take(), 30.0)  # U1 is not kept by who waits for U2
    taking.cancel()
    await asyncio.wait([taking])


class Lost:
    """A name that is held no more."""

    is_held = False


async def test_who_has_lost_a_name_stops(begin: Begin) -> None:
    holds = begin("U1")
    await holds.take()
    lost: Hold = Lost()
    holds._holds = [lost]
    with pytest.raises(HoldLostError, match="another process may have taken over"):
        holds.require()
