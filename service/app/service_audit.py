"""Audit entries of the service itself: start, stop, configuration and clock steps."""

import asyncio
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version

import structlog

from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival
from service.api.auth.refusals import Refusals
from service.measuring.alarms.host_time import STEP_S
from service.runtime.heartbeats import UNHEARD, Pulse
from service.settings.configuration import built_from, configuration_of
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.access.audit_entry import AuditEntry, Deed
from service.store.audit_port import AuditQuery, AuditStore
from service.store.port import StoreError

PADWATCH, SERVICE, CONFIGURATION, CLOCK = "padwatch", "service", "configuration", "clock"
STARTED, STOPPED, CHANGED = "service.started", "service.stopped", "configuration.changed"
STEPPED = "clock.stepped"


@dataclass(frozen=True)
class Release:
    """Which padwatch runs with which configuration.

    Parameters
    ----------
    version
        Of padwatch.
    configuration
        Version of the configuration, under which it is kept beside the evidence.
    origin
        Whether it is live or a replay.
    """

    version: str
    configuration: str
    origin: str


def start_deeds(release: Release, last_start: AuditEntry | None, now_ns: int) -> list[Deed]:
    """That the service starts, and first whether its configuration has changed since it did last.

    Parameters
    ----------
    last_start
        Newest entry that tells of a start; None if there is none.
    """
    before = _configuration_of(last_start)
    started = Deed(now_ns, PADWATCH, STARTED, SERVICE, after=vars(release))
    if before is None or before == release.configuration:
        return [started]
    versions = ({CONFIGURATION: before}, {CONFIGURATION: release.configuration})
    changed = Deed(now_ns, PADWATCH, CHANGED, CONFIGURATION, *versions)
    return [changed, started]


def stop_deed(release: Release, refusals: int, now_ns: int) -> Deed:
    """That the service stops.

    Parameters
    ----------
    refusals
        How many refused requests have no entry of their own since the last that has one.
    """
    after = {"n_refused_more": refusals} if refusals else None
    return Deed(now_ns, PADWATCH, STOPPED, SERVICE, before=vars(release), after=after)


def step_deed(step_s: float, now_ns: int) -> Deed:
    """That the clock of the host was set, forward or, below 0, back; `now_ns` is by the new one."""
    return Deed(now_ns, PADWATCH, STEPPED, CLOCK, after={"by_s": round(step_s, 3)})


def _configuration_of(start: AuditEntry | None) -> str | None:
    document = json.loads(start.after) if start and start.after else None
    return document.get(CONFIGURATION) if isinstance(document, dict) else None


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
