"""What is told of changes in the store: alarms, baselines and references."""

from collections.abc import Sequence
from dataclasses import asdict

from core.alarms.alarm import Alarm, AlarmEvent, AlarmNews, Hold
from service.store.access.audit_entries import ActedNews, AuditAction, Source, acting
from service.store.baselines import Versions, select_steps, versions_after
from service.store.database import Connection
from service.store.film_port import BaselineStep, StoredStep
from service.store.gap_reference import GapReference
from service.store.references import select_history
from service.store.vector_reference_port import SetVectorReference

PADWATCH = "padwatch"


def alarm_deeds(event: AlarmEvent, told: AlarmNews) -> list[AuditAction]:
    """What somebody did to an alarm; nothing if nobody did it."""
    if not event.actor:
        return []
    level = None if event.level is None else event.level.name.lower()
    after = {
        "state": event.state_after.value,
        "level": level,
        "occurrence": event.occurrence,
        **_holds(told.alarm),
    }
    deed = AuditAction(
        time_ns=event.time_ns,
        actor=event.actor,
        action=f"alarm.{event.change.value}",
        object=event.identity.id,
        before={"state": event.state_before.value},
        after=after,
        reason=event.reason,
        source=Source.API,  # nobody reaches alarms by any other way
        peer=told.peer if isinstance(told, ActedNews) else None,
    )
    return [deed]


def step_deeds(writer: Connection, steps: Sequence[StoredStep]) -> list[AuditAction]:
    """What is about to be done to baselines, and where they stand before and after it."""
    deeds = []
    for place in dict.fromkeys((step.unit, step.bearing) for step in steps):
        done = select_steps(writer, *place)
        for step in steps:
            if (step.unit, step.bearing) != place:
                continue
            before = versions_after(done)
            done.append(step)
            if step.step is not BaselineStep.LEARNED or step.actor != PADWATCH:
                deeds.append(_step_deed(step, before, versions_after(done)))
    return deeds


def reference_deed(writer: Connection, reference: GapReference) -> AuditAction:
    """A reference that is about to be set, after the one that rules until then."""
    history = select_history(writer, reference.unit, reference.bearing)
    return AuditAction(
        time_ns=reference.set_ns,
        actor=reference.author,
        action="gap_reference.set",
        object=f"{reference.unit}:{reference.bearing}",
        before=_gaps(history[0]) if history else None,
        after=_gaps(reference),
        reason=reference.note,
        source=acting().source,
        peer=acting().peer,
    )


def vector_deed(before: SetVectorReference | None, reference: SetVectorReference) -> AuditAction:
    """A reference of 1× that is about to be set, after the one that rules until then."""
    found = reference.reference
    return AuditAction(
        time_ns=reference.set_ns,
        actor=reference.author,
        action="order1_reference.set",
        object=f"{found.unit}:{found.bearing}:{found.state.name.lower()}",
        before=None if before is None else _vectors(before),
        after=_vectors(reference),
        reason=reference.note,
        source=acting().source,
        peer=acting().peer,
    )


def _step_deed(step: StoredStep, before: Versions, after: Versions) -> AuditAction:
    who = acting()
    return AuditAction(
        time_ns=step.time_ns,
        actor=step.actor,
        action=f"baseline.{step.step.value}",
        object=":".join(
            str(part) for part in (step.unit, step.bearing, step.version) if part is not None
        ),
        before=_standing(before),
        after=_standing(after),
        reason=step.reason,
        source=who.source,
        peer=who.peer,
    )


def _standing(versions: Versions) -> dict[str, object]:
    return asdict(versions) | {"rejected": sorted(versions.rejected)}


def _holds(alarm: Alarm) -> dict[str, object]:
    return {
        name: asdict(hold)
        for name, hold in (("shelf", alarm.shelf), ("outage", alarm.outage))
        if isinstance(hold, Hold)
    }


def _gaps(reference: GapReference) -> dict[str, object]:
    return {
        "author": reference.author,
        "set_ns": reference.set_ns,
        "gap_reference_um": list(reference.gap_reference_um),
        "opposite_reference_um": reference.opposite_reference_um,
        "source": reference.source.value,
    }


def _vectors(reference: SetVectorReference) -> dict[str, object]:
    vectors = {place: asdict(vector) for place, vector in reference.reference.vectors.items()}
    return {"author": reference.author, "set_ns": reference.set_ns, "vectors": vectors}
