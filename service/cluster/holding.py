"""One process for each unit at a time: whoever has its name analyses it, others wait."""

import asyncio
from collections.abc import Iterable, Sequence
from contextlib import ExitStack

import structlog

from acquisition.clock import Clock
from service.store.database import Hold
from service.store.port import Store, StoreError

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
