"""Which process owns a unit or the plant."""

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
    """Somebody else may analyse a unit now, since the connection to the database was lost."""


class Holds:
    """The names of some units, all of them or none."""

    def __init__(self, store: Store, units: Iterable[str], clock: Clock) -> None:
        self._store, self._clock = store, clock
        self._names = [f"analyse {unit}" for unit in sorted(units)]
        self._stack = ExitStack()
        self._holds: Sequence[Hold] = ()
        self.waits_for: str | None = "not begun"

    async def take(self) -> None:
        """Wait until all are free, and have them: a standby waits here for as long as need be."""
        while True:
            refusal = await asyncio.to_thread(self._try)
            if refusal is None:
                break
            if refusal != self.waits_for:
                log.info("standing by", reason=refusal)
            self.waits_for = refusal
            await self._clock.sleep(EVERY_S)
        self.waits_for = None

    def require(self) -> None:
        """Raise `HoldLostError` where not all are held any more."""
        if not all(hold.is_held for hold in self._holds):
            raise HoldLostError(
                "the connection to the database was lost, and with it the right to analyse these"
                " units: another process may have taken over"
            )

    def release(self) -> None:
        """Let others have them."""
        self._stack.close()

    def _try(self) -> str | None:
        """Take all; returns why not."""
        with ExitStack() as stack:
            try:
                self._holds = [stack.enter_context(self._store.hold(name)) for name in self._names]
            except StoreError as error:
                return str(error)
            self._stack = stack.pop_all()
        return None


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


FORM = re.compile(r"([0-9]{1,4})/([0-9]{1,4})")


@dataclass(frozen=True)
class Partition:
    """The ``number``-th of ``n_parts``, counted from 1."""

    number: int = 1
    n_parts: int = 1

    @classmethod
    def of(cls, text: str) -> "Partition":
        """Read it from ``i/n``. Raises `ValueError` if it is none."""
        found = FORM.fullmatch(text)
        part = cls(int(found[1]), int(found[2])) if found else cls(0, 0)
        if not 1 <= part.number <= part.n_parts:
            raise ValueError(
                f"{text!r} is no partition: give i/n with i from 1 to n, such as 1/2 and 2/2"
            )
        return part

    def units(self, units: Sequence[str]) -> list[str]:
        """Those that it analyses: every n-th of the sorted ids, so that all have about as many."""
        return sorted(units)[self.number - 1 :: self.n_parts]

    def part_of(self, plant: PlantFile) -> PlantFile:
        """The plant as far as it is analysed here.

        Raises
        ------
        ValueError
            If that is no unit at all.
        """
        mine = set(self.units([unit.id for unit in plant.unit]))
        if not mine:
            raise ValueError(
                f"partition {self.number}/{self.n_parts} of {len(plant.unit)} units is empty: give"
                f" no more than {len(plant.unit)} parts"
            )
        return plant.model_copy(update={"unit": tuple(u for u in plant.unit if u.id in mine)})

    def share_of(self, plant: PlantFile) -> PlantPart:
        """What this process looks after of a whole plant."""
        every = [unit.id for unit in plant.unit]
        own = frozenset(self.units(every))
        return PlantPart(own, frozenset(every) - own, leads=self.number == 1)
