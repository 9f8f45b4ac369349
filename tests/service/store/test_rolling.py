"""The loop that gathers: everything that is due, resting in between, through trouble."""

import asyncio
from collections.abc import Sequence

import pytest
from rigs.standing_clock import StandingClock

from service.store.loops import ROLLUP_PERIOD_S, RollupLoop
from service.store.port import StoreError


class Pile:
    """Roll-ups of bearings with some pieces of work each; the store may fail at times."""

    def __init__(self, *pieces: int) -> None:
        self.pieces = list(pieces)
        self.failures = 0

    def due(self, now_ns: int) -> Sequence[int]:
        del now_ns
        if self.failures:
            self.failures -= 1
            raise StoreError("disk full")
        return [series for series, left in enumerate(self.pieces) if left]

    def gather(self, series: int, now_ns: int) -> None:
        del now_ns
        self.pieces[series] -= 1


class Clock(StandingClock):
    """Time that passes when somebody waits, and ends when everything that was due is done."""

    def __init__(self, pile: Pile) -> None:
        super().__init__()
        self._pile = pile

    async def sleep(self, duration_s: float) -> None:
        self.s += duration_s
        if duration_s == ROLLUP_PERIOD_S and not any(self._pile.pieces):
            raise asyncio.CancelledError


async def rested_s(pile: Pile) -> float:
    """Gather everything; returns for how long the loop has rested."""
    clock = Clock(pile)
    with pytest.raises(asyncio.CancelledError):
        await RollupLoop(pile, clock).run()
    return clock.s


async def test_all_that_is_due_is_gathered_before_the_loop_rests() -> None:
    pile = Pile(3, 0, 5)

    assert await rested_s(pile) == ROLLUP_PERIOD_S
    assert pile.pieces == [0, 0, 0]


async def test_a_store_that_fails_is_asked_again_later() -> None:
    pile = Pile(2)
    pile.failures = 3

    assert await rested_s(pile) == 4 * ROLLUP_PERIOD_S
    assert pile.pieces == [0]
