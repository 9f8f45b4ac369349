"""Document of a bundle, strict and versioned, and its composition from a snapshot."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from core.change.settings import FilmRules
from service.api.routes.alarm_models import LEVEL_NAMES
from service.reports.contents import bearing_part
from service.reports.parts import (
    BearingPart,
    ComparisonPart,
    Direction,
    EvidencePart,
    LevelWord,
    Moment,
    Sha256,
    finite,
)
from service.reports.snapshot import BearingSnapshot, Snapshot
from service.runtime.files import CHUNK
from service.runtime.times import rfc3339
from service.settings.alarm_kinds import value_unit
from service.settings.configuration import Configuration, canonical, without_secrets
from service.settings.plant import PlantFile
from service.settings.storage import Origin

FORMAT = "padwatch-evidence"
VERSION = 1


class AlarmPart(EvidencePart):
    """The alarm and the event that began this occurrence of it."""

    id: Annotated[str, Field(examples=["U1:UJB:stiffness_x"])]
    """Identifier."""

    unit: Annotated[str, Field(examples=["U1"])]
    """Unit; "plant" for the service itself."""

    subject: Annotated[str, Field(examples=["UJB"])]
    """Bearing, channel or part that it is about."""

    kind: Annotated[str, Field(examples=["stiffness_x"])]
    """What is wrong."""

    occurrence: int
    """Counts how often it was raised or rose in level."""

    change: Annotated[str, Field(examples=["raised"])]
    """raised or escalated."""

    level: LevelWord | None
    """Level that it has since."""

    state: Annotated[str, Field(examples=["unacknowledged"])]
    """State that it had since."""

    time: Moment
    """When."""

    time_ns: int
    """The same, nanoseconds since 1970 UTC."""

    value: float | None
    """What was compared with the limit; of a film's change, in ln."""

    limit: float | None
    """The limit."""

    value_unit: str | None
    """Unit of both."""

    reason: Annotated[str, Field(examples=["film"])]
    """Why, in a word."""


class UnitPart(EvidencePart):
    """The unit at that moment."""

    id: Annotated[str, Field(examples=["U1"])]
    """Identifier."""

    name: str
    """Name, or empty."""

    link: Annotated[str, Field(examples=["connected"])]
    """Whether samples arrived."""

    link_reason: str | None
    """Why not."""

    last_sample: Moment | None
    """Time of the newest sample, by the device's clock."""


class FilePart(EvidencePart):
    """A file beside this one."""

    size: int
    """Bytes."""

    sha256: Sha256
    """Hash of its bytes."""


class Evidence(EvidencePart):
    """All that was known when an alarm was raised, or rose in level."""

    format: Literal["padwatch-evidence"]
    """Always this."""

    version: Literal[1]
    """Of the format."""

    made_by: Annotated[str, Field(examples=["padwatch 0.1.0"])]
    """Program and its version."""

    origin: Literal["live", "replay"]
    """Whether a machine was watched, or a recording played."""

    plant: Annotated[str, Field(examples=["Itaipu"])]
    """Name of the plant."""

    taken: Moment
    """When this was noted down, host time."""

    configuration: Sha256
    """Version of the configuration: names the file that holds it in full."""

    alarm: AlarmPart
    """The alarm."""

    unit: UnitPart | None
    """The unit; null for the service itself."""

    bearing: str | None
    """Bearing that the alarm is about, if it is about one."""

    direction: Direction | None
    """Direction, likewise."""

    bearings: list[BearingPart]
    """All bearings of the unit, that of the alarm first."""

    comparisons: list[ComparisonPart]
    """The films of the alarm's bearing with what they were compared with."""

    limits: dict[str, Any]
    """Settings that applied, as in the plant file: of alarms, films, analysis and the bearing."""

    missing: list[str]
    """What could not be had, in sentences."""

    samples_expected: bool
    """Whether the samples around the alarm were going to be kept."""

    files: dict[str, FilePart]
    """The files beside this one, but for those that came later."""

    sha256: Sha256
    """Of this document without this line: keys sorted, no spaces, UTF-8."""


def file_part(path: Path) -> FilePart:
    """Size and hash of a file."""
    hashed, size = hashlib.sha256(), 0
    with path.open("rb") as file:
        while chunk := file.read(CHUNK):
            hashed.update(chunk)
            size += len(chunk)
    return FilePart(size=size, sha256=hashed.hexdigest())


@dataclass(frozen=True)
class Maker:
    """Who makes bundles, and of which plant.

    Parameters
    ----------
    made_by
        Program and its version; the host and its user are nothing for a reader of evidence.
    """

    plant: PlantFile
    configuration: Configuration
    made_by: str
    origin: Origin


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
