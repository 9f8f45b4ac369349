"""`ServiceTrail`: what the running service tells the audit trail of itself."""

import asyncio
from collections.abc import Callable
from functools import partial
from importlib.metadata import version

import structlog

from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival
from service.api.auth.refusals import Refusals
from service.app.service_audit import STARTED, Release, start_deeds, step_deed, stop_deed
from service.measuring.service_alarms import STEP_S
from service.runtime.heartbeats import UNHEARD, Pulse
from service.settings.configuration import built_from, configuration_of
from service.settings.origin import Origin
from service.settings.plant import PlantFile
from service.store.audit_port import AuditQuery, AuditStore
from service.store.port import StoreError

log = structlog.get_logger()

LOOK_S = 1.0


class ServiceTrail:
    """Tells of starts, stops and steps of the clock; a plant is watched also where that fails.

    Parameters
    ----------
    audit
        Where it is written.
    """

    def __init__(self, plant: PlantFile, origin: Origin, audit: AuditStore, clock: Clock) -> None:
        program = version("padwatch")
        configuration = configuration_of(plant, program, built_from())
        self._release = Release(program, configuration.version, origin.value)
        self._audit, self._clock = audit, clock
        self.refusals = Refusals(audit, clock)

    async def begin(self) -> None:
        """Tell that the service starts, and whether its configuration has changed."""
        await asyncio.to_thread(self._tell, self._start)

    async def end(self) -> None:
        """Tell that it stops."""
        await asyncio.to_thread(self._tell, self._stop)

    async def watch_clock(self, pulse: Pulse = UNHEARD) -> None:
        """Tell, for ever, when the host's clock is set, after which times cannot be compared."""
        seen = Arrival.now(self._clock)
        while True:
            pulse.beat(LOOK_S)
            await self._clock.sleep(LOOK_S)
            before, seen = seen, Arrival.now(self._clock)
            step_s = seen.step_s_since(before)
            if abs(step_s) > STEP_S:
                deed = step_deed(step_s, seen.host_ns)
                await asyncio.to_thread(self._tell, partial(self._audit.record, [deed]))

    def _start(self) -> None:
        last = self._audit.entries(AuditQuery(limit=1, action=STARTED))
        now_ns = self._clock.now_ns()
        self._audit.record(start_deeds(self._release, last[0] if last else None, now_ns))

    def _stop(self) -> None:
        deed = stop_deed(self._release, self.refusals.n_more, self._clock.now_ns())
        self._audit.record([deed])

    def _tell(self, write: Callable[[], None]) -> None:
        try:
            write()
        except StoreError as error:
            log.error("the audit trail cannot be written", reason=str(error))
