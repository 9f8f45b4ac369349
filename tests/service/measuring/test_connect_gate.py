"""A hundred devices that vanish and return together are not stormed."""

import asyncio
import heapq

import numpy as np

from service.measuring.acquirer import ConnectGate

PER_S = 50.0
POLL_S = 0.5
BACK_S = 30.0


class VirtualClock:
    """Time that jumps to the next sleeper's end when all are asleep."""

    def __init__(self) -> None:
        self._now_s = 0.0
        self._sleepers: list[tuple[float, int, asyncio.Future[None]]] = []
        self._n = 0

    def monotonic_s(self) -> float:
        return self._now_s

    async def sleep(self, duration_s: float) -> None:
        waiting: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._n += 1
        heapq.heappush(self._sleepers, (self._now_s + duration_s, self._n, waiting))
        await waiting

    async def run(self) -> None:
        while True:
            for _ in range(5):
                await asyncio.sleep(0)
            if self._sleepers:
                self._now_s, _, waiting = heapq.heappop(self._sleepers)
                if not waiting.done():
                    waiting.set_result(None)


async def test_a_hundred_absent_devices_are_tried_evenly_and_a_single_one_is_not_held_up():
    clock, jitter = VirtualClock(), np.random.default_rng(1)
    gate = ConnectGate(PER_S, clock)
    attempts: list[float] = []
    back: list[float] = []

    async def device() -> None:
        while True:
            await gate.turn()
            attempts.append(clock.monotonic_s())
            if clock.monotonic_s() >= BACK_S:
                back.append(clock.monotonic_s())
                return
            await clock.sleep(POLL_S * jitter.uniform(0.5, 1.0))

    running = asyncio.create_task(clock.run())
    async with asyncio.timeout(60), asyncio.TaskGroup() as tasks:
        for _ in range(100):
            tasks.create_task(device())
    running.cancel()

    attempts.sort()
    for first, last in zip(attempts, attempts[50:], strict=False):
        assert last - first >= 1.0 - 1e-6  # never more than 50 in a second
    assert len(back) == 100
    assert max(back) - BACK_S <= 100 / PER_S + POLL_S

    clock = VirtualClock()
    gate = ConnectGate(PER_S, clock)
    await gate.turn()
    assert clock.monotonic_s() == 0.0
