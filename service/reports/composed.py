"""The document of a bundle, put together from a snapshot."""

import hashlib
from typing import Any

from core.change.settings import FilmRules
from service.api.routes.alarm_models import LEVEL_NAMES
from service.reports.described import bearing_part
from service.reports.document import FORMAT, VERSION, AlarmPart, Evidence, UnitPart
from service.reports.maker import Maker
from service.reports.parts import Direction, finite
from service.reports.snapshot import BearingSnapshot, Snapshot
from service.runtime.times import rfc3339
from service.settings.alarm_kinds import value_unit
from service.settings.configuration import canonical, without_secrets
from service.settings.plant import PlantFile


def sealed(document: dict[str, Any]) -> bytes:
    """The document as its file has it, with the hash of all the rest."""
    nobody = "0" * 64
    blank = Evidence(**document, sha256=nobody)
    content = blank.model_dump(mode="json", by_alias=True)
    content.pop("sha256")
    whole = blank.model_copy(update={"sha256": hashlib.sha256(canonical(content)).hexdigest()})
    return (whole.model_dump_json(by_alias=True, indent=1) + "\n").encode()


def composed(snapshot: Snapshot, maker: Maker) -> dict[str, Any]:
    """All of a document that needs neither store nor disk."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "made_by": maker.made_by,
        "origin": maker.origin.value,
        "plant": maker.plant.plant.name,
        "taken": rfc3339(snapshot.taken_ns),
        "configuration": maker.configuration.version,
        "alarm": _alarm(snapshot),
        "unit": _unit(snapshot, maker.plant),
        "bearing": snapshot.bearing,
        "direction": _direction(snapshot),
        "bearings": [
            bearing_part(each.assessment, each.film, snapshot.rules)
            for each in snapshot.bearings.values()
            if each.assessment is not None
        ],
        "limits": _limits(snapshot, maker.plant, snapshot.rules),
        "samples_expected": snapshot.samples_expected,
    }


def _alarm(snapshot: Snapshot) -> AlarmPart:
    event, identity = snapshot.event, snapshot.event.identity
    return AlarmPart(
        id=identity.id,
        unit=identity.unit,
        subject=identity.subject,
        kind=identity.kind,
        occurrence=event.occurrence,
        change=event.change.value,
        level=None if event.level is None else LEVEL_NAMES[event.level],
        state=event.state_after.value,
        time=rfc3339(event.time_ns),
        time_ns=event.time_ns,
        value=finite(event.value),
        limit=finite(event.limit),
        value_unit=value_unit(identity.kind),
        reason=str(event.reason),
    )


def _unit(snapshot: Snapshot, plant: PlantFile) -> UnitPart | None:
    status, id_ = snapshot.status, snapshot.event.identity.unit
    if status is None:
        return None
    last_ns = status.last_sample_ns
    return UnitPart(
        id=id_,
        name=next((unit.name for unit in plant.unit if unit.id == id_), ""),
        link=status.state.value,
        link_reason=status.reason,
        last_sample=None if last_ns is None else rfc3339(last_ns),
    )


def _direction(snapshot: Snapshot) -> Direction | None:
    kind = snapshot.event.identity.kind
    if kind.endswith("_x"):
        return "x"
    return "y" if kind.endswith("_y") else None


def _limits(snapshot: Snapshot, plant: PlantFile, rules: FilmRules | None) -> dict[str, Any]:
    """Settings that applied, without secrets."""
    found: dict[str, Any] = {
        "alarms": plant.alarms.model_dump(mode="json"),
        "analysis": plant.analysis.model_dump(mode="json"),
    }
    if rules is not None:
        found["films"] = plant.films.model_dump(mode="json")
        found["estimators"] = {each: name.value for each, name in rules.estimators.items()}
    unit = next((each for each in plant.unit if each.id == snapshot.event.identity.unit), None)
    bearings = () if unit is None else unit.bearing
    found["bearing"] = next(
        (each.model_dump(mode="json") for each in bearings if each.id == snapshot.bearing), None
    )
    shown: dict[str, Any] = without_secrets(found)
    return shown


def not_known(snapshot: Snapshot) -> list[str]:
    """What was not known yet when the alarm came."""
    own: BearingSnapshot | None = snapshot.bearings.get(snapshot.bearing or "")
    found = [
        f"bearing {each} had no result yet"
        for each, known in snapshot.bearings.items()
        if known.assessment is None
    ]
    if own is not None and snapshot.rules is not None and own.film is None:
        found.append("no reading of the film had been judged since the service started")
    return found
