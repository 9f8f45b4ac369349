"""Ownership of units: partitions, and database locks of units and of plant-wide tasks."""

import asyncio
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass

import structlog

from acquisition.clock import Clock
from service.measuring.alarm_engine import PlantPart
from service.runtime.heartbeats import Heartbeats, Loop, Pulse
from service.settings.plant import PlantFile
from service.store.database import Hold
from service.store.port import StoreError
from service.store.store import Store

log = structlog.get_logger()

EVERY_S = 1.0


class HoldLostError(StoreError):
    """Error raised if the database connection was lost, and with it the locks of the units."""


class Holds:
    """Exclusive database locks for the analysis of units, one per unit; all or none are held."""

    def __init__(self, store: Store, units: Iterable[str], clock: Clock) -> None:
        self._store, self._clock = store, clock
        self._names = [f"analyse {unit}" for unit in sorted(units)]
        self._stack = ExitStack()
        self._holds: Sequence[Hold] = ()
        self.waits_for: str | None = "not started"

    async def take(self) -> None:
        """Acquire all locks; wait while another process holds any of them or the database fails."""
        while True:
            try:
                await asyncio.to_thread(self._try)
            except StoreError as error:
                if str(error) != self.waits_for:
                    reason = self.waits_for = str(error)
                    log.info("standing by until the locks of the units are free", reason=reason)
                await self._clock.sleep(EVERY_S)
            else:
                self.waits_for = None
                return

    def require(self) -> None:
        """Raise `HoldLostError` if a lock is no longer held."""
        if not all(hold.is_held for hold in self._holds):
            raise HoldLostError(
                "the connection to the database was lost, and with it the locks of the units;"
                " another process may have taken over"
            )

    def release(self) -> None:
        """Release all locks."""
        self._stack.close()

    def _try(self) -> None:
        with ExitStack() as stack:
            self._holds = [stack.enter_context(self._store.hold(name)) for name in self._names]
            self._stack = stack.pop_all()


SHARED_WORK = "shared work"
"""Name of the lock for the plant-wide tasks: notifications, roll-ups, retention and checks."""

TRY_EVERY_S = 2.0
LOOK_EVERY_S = 1.0


class Leadership:
    """Leader election among processes: the one that holds a database lock runs plant-wide tasks.

    When the lock passes to another process, both may run the tasks for a short time; the tasks are
    idempotent.
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
        """Run the plant-wide tasks while the database lock is held, else wait for the lock.

        This is repeated until the task is cancelled; `pulse` receives heartbeats.
        """
        while True:
            pulse.beat(TRY_EVERY_S)
            with ExitStack() as held:
                try:
                    hold = await asyncio.to_thread(held.enter_context, self._hold(SHARED_WORK))
                except StoreError:
                    pass  # another process holds the lock, or no connection: retry
                else:
                    await self._lead(hold, pulse)
            await self._clock.sleep(TRY_EVERY_S)

    async def _lead(self, hold: Hold, pulse: Pulse) -> None:
        log.info("this process starts the plant-wide tasks")
        self.is_leading = True
        try:
            async with asyncio.TaskGroup() as tasks:
                begun = self._beats.start(self._loops, tasks)
                while await asyncio.to_thread(lambda: hold.is_held):
                    pulse.beat(LOOK_EVERY_S)
                    await self._clock.sleep(LOOK_EVERY_S)
                for task in begun:
                    task.cancel()
        finally:
            self.is_leading = False
            self._beats.release(*self._loops)
        log.warning("the database lock is lost; this process stops the plant-wide tasks")


FORM = re.compile(r"([0-9]{1,4})/([0-9]{1,4})")


@dataclass(frozen=True)
class Partition:
    """Part of the units of a plant that one process analyses: part `number` of `n_parts`."""

    number: int = 1
    n_parts: int = 1

    @classmethod
    def of(cls, text: str) -> "Partition":
        """Parse a partition ``i/n``, such as ``1/2``; raise `ValueError` if it is malformed."""
        found = FORM.fullmatch(text)
        part = cls(int(found[1]), int(found[2])) if found else cls(0, 0)
        if not 1 <= part.number <= part.n_parts:
            words = f"invalid partition '{text}'; use i/n with i from 1 to n, such as 1/2"
            raise ValueError(words)
        return part

    def units(self, units: Sequence[str]) -> list[str]:
        """Return the unit ids of this part: every ``n_parts``-th of the sorted ids `units`."""
        return sorted(units)[self.number - 1 :: self.n_parts]

    def part_of(self, plant: PlantFile) -> PlantFile:
        """Return a copy of the plant file that has only the units of this part.

        Raises `ValueError` if this part has no units.
        """
        mine = set(self.units([unit.id for unit in plant.unit]))
        if not mine:
            raise ValueError(
                f"partition {self.number}/{self.n_parts} of {len(plant.unit)} units is empty:"
                f" use at most {len(plant.unit)} parts"
            )
        return plant.model_copy(update={"unit": tuple(u for u in plant.unit if u.id in mine)})

    def share_of(self, plant: PlantFile) -> PlantPart:
        """Return the units of this part and of the others; part 1 has the plant-wide alarms."""
        every = [unit.id for unit in plant.unit]
        own = frozenset(self.units(every))
        return PlantPart(own, frozenset(every) - own, leads=self.number == 1)
