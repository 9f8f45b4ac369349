"""Audit entries of the service: start, stop, changed configuration and clock steps."""

import asyncio
import json
from collections.abc import Callable, Mapping
from importlib.metadata import version

import structlog

from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival
from service.app.storage import built_configuration
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.times import CLOCK_STEP_S
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.access.audit_entries import AuditAction, AuditEntry
from service.store.audit import AuditQuery, AuditStore
from service.store.port import StoreError

PADWATCH, SERVICE, CONFIGURATION, CLOCK = "padwatch", "service", "configuration", "clock"
STARTED, STOPPED, CHANGED = "service.started", "service.stopped", "configuration.changed"
STEPPED = "clock.stepped"


def start_deeds(
    release: Mapping[str, str], last_start: AuditEntry | None, now_ns: int
) -> list[AuditAction]:
    """Return the audit entries of a service start; a changed configuration comes first.

    `release` has the versions of padwatch and of the configuration, and the origin of the data;
    `last_start` is the audit entry of the previous start; None for the first start. `now_ns` is the
    host time, ns since 1970 UTC.
    """
    last = json.loads(last_start.after) if last_start and last_start.after else None
    before = last.get(CONFIGURATION) if isinstance(last, dict) else None
    now = release[CONFIGURATION]
    started = AuditAction(now_ns, PADWATCH, STARTED, SERVICE, after=release)
    if before is None or before == now:
        return [started]
    versions = ({CONFIGURATION: before}, {CONFIGURATION: now})
    return [AuditAction(now_ns, PADWATCH, CHANGED, CONFIGURATION, *versions), started]


log = structlog.get_logger()

LOOK_S = 1.0


class ServiceTrail:
    """Recorder of the service's audit entries; a failed write is logged and not repeated."""

    def __init__(self, plant: PlantFile, origin: Origin, audit: AuditStore, clock: Clock) -> None:
        configuration = built_configuration(plant).version
        self._release = {
            "version": version("padwatch"),
            CONFIGURATION: configuration,
            "origin": origin.value,
        }
        self._audit, self._clock = audit, clock

    async def begin(self) -> None:
        """Record the start of the service, and the configuration if it has changed."""
        await self._attempt(self._record_start)

    async def end(self) -> None:
        """Record the stop of the service."""
        now_ns = self._clock.now_ns()
        deed = AuditAction(now_ns, PADWATCH, STOPPED, SERVICE, before=self._release)
        await self._attempt(self._audit.record, [deed])

    async def watch_clock(self, pulse: Pulse = UNHEARD) -> None:
        """Record steps of the host clock above `CLOCK_STEP_S` seconds, until cancelled."""
        seen = Arrival.now(self._clock)
        while True:
            pulse.beat(LOOK_S)
            await self._clock.sleep(LOOK_S)
            before, seen = seen, Arrival.now(self._clock)
            step_s = seen.step_s_since(before)
            if abs(step_s) > CLOCK_STEP_S:
                step = {"by_s": round(step_s, 3)}
                deed = AuditAction(seen.host_ns, PADWATCH, STEPPED, CLOCK, after=step)
                await self._attempt(self._audit.record, [deed])

    def _record_start(self) -> None:
        last = self._audit.entries(AuditQuery(limit=1, action=STARTED))
        now_ns = self._clock.now_ns()
        self._audit.record(start_deeds(self._release, last[0] if last else None, now_ns))

    async def _attempt(self, write: Callable[..., None], *arguments: object) -> None:
        try:
            await asyncio.to_thread(write, *arguments)
        except StoreError as error:
            log.error("the audit trail cannot be written", reason=str(error))
