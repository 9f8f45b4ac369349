"""`Leadership`: does what only one process of a plant may do, in whichever process is there."""

import asyncio
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack

import structlog

from acquisition.clock import Clock
from service.runtime.heartbeats import Heartbeats, Loop, Pulse
from service.store.database import Hold
from service.store.port import StoreError

log = structlog.get_logger()

SHARED_WORK = "shared work"
"""Name that is held: messages, roll-ups, and what lets old results go."""

TRY_EVERY_S = 2.0
LOOK_EVERY_S = 1.0


class Leadership:
    """Runs loops while it holds a name in the database; another process does when it does not.

    What these loops do may be done twice at a change of hands (a message is told again, a roll-up
    gathered anew), and all of it counts once.

    Parameters
    ----------
    hold
        Takes a name; raises `StoreError` while somebody else holds it.
    loops
        By name.
    """

    def __init__(
        self,
        hold: Callable[[str], AbstractContextManager[Hold]],
        loops: Mapping[str, Loop],
        beats: Heartbeats,
        clock: Clock,
    ) -> None:
        self._hold, self._loops, self._beats, self._clock = hold, loops, beats, clock
        self.is_leading = False

    async def run(self, pulse: Pulse) -> None:
        """Lead whenever nobody else does, for ever."""
        while True:
            pulse.beat(TRY_EVERY_S)
            with ExitStack() as held:
                try:
                    hold = await asyncio.to_thread(held.enter_context, self._hold(SHARED_WORK))
                except StoreError:
                    pass  # somebody else's, or the database is away: both may change
                else:
                    await self._lead(hold, pulse)
            await self._clock.sleep(TRY_EVERY_S)

    async def _lead(self, hold: Hold, pulse: Pulse) -> None:
        log.info("does the shared work of the plant from now on")
        self.is_leading = True
        try:
            async with asyncio.TaskGroup() as tasks:
                begun = [
                    tasks.create_task(self._beats.tend(name, loop), name=name)
                    for name, loop in self._loops.items()
                ]
                while await asyncio.to_thread(lambda: hold.is_held):
                    pulse.beat(LOOK_EVERY_S)
                    await self._clock.sleep(LOOK_EVERY_S)
                for task in begun:
                    task.cancel()
        finally:
            self.is_leading = False
            self._beats.release(*self._loops)
        log.warning("does the shared work of the plant no longer: the name is lost")
