"""What padwatch tells of itself: start, stop, configuration, and that its host's clock was set."""

import json
from dataclasses import dataclass

from service.store.access.audit_entries import AuditEntry, Deed

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
