"""The loop that gathers: everything that is due, resting in between, through trouble."""

import asyncio
from collections.abc import Sequence

from service.rolling import PERIOD_S, Rolling
from service.store.port import StoreError


class Pile:
    """Roll-ups of bearings with some pieces of work each; the store may fail at times."""

    def __init__(self, *pieces: int) -> None:
        self.pieces = list(pieces)
        self.failures = 0
        self.all_done = asyncio.Event()

    def due(self, now_ns: int) -> Sequence[int]:
        del now_ns
        if self.failures:
            self.failures -= 1
            raise StoreError("disk full")
        return [series for series, left in enumerate(self.pieces) if left]

    def gather(self, series: int, now_ns: int) -> None:
        del now_ns
        self.pieces[series] -= 1


class Clock:
    """Time that passes when somebody waits; tells when everything that was due is done."""

    def __init__(self, pile: Pile) -> None:
        self._pile, self.slept_s = pile, 0.0

    def now_ns(self) -> int:
        return 0

    def monotonic_s(self) -> float:
        return self.slept_s

    async def sleep(self, duration_s: float) -> None:
        self.slept_s += duration_s
        if duration_s == PERIOD_S and not any(self._pile.pieces):
            self._pile.all_done.set()
        await asyncio.sleep(0)


async def done(pile: Pile) -> Clock:
    clock = Clock(pile)
    task = asyncio.create_task(Rolling(pile, clock).run())
    await pile.all_done.wait()
    task.cancel()
    return clock


async def test_all_that_is_due_is_gathered_before_the_loop_rests() -> None:
    pile = Pile(3, 0, 5)

    clock = await done(pile)

    assert pile.pieces == [0, 0, 0]
    assert clock.slept_s == PERIOD_S


async def test_a_store_that_fails_is_asked_again_later() -> None:
    pile = Pile(2)
    pile.failures = 3

    clock = await done(pile)

    assert pile.pieces == [0]
    assert clock.slept_s == 4 * PERIOD_S
