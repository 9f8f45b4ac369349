"""Evidence document of a bundle, strict and versioned, and its composition from a snapshot."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from core.alarms.kinds import FILM_STIFFNESS
from core.baseline.history import QUANTITIES
from service.reports.contents import bearing_part
from service.reports.parts import (
    AXES,
    BearingPart,
    ComparisonPart,
    Direction,
    EvidencePart,
    Sha256,
)
from service.reports.snapshot import Snapshot
from service.runtime.files import CHUNK
from service.runtime.models import ByName, Finite, Time
from service.runtime.times import rfc3339
from service.settings.alarm_kinds import AlarmLevelName, value_unit
from service.settings.configuration import Configuration, canonical, without_secrets
from service.settings.plant import PlantFile
from service.settings.storage import Origin

FORMAT = "padwatch-evidence"
VERSION = 1


class AlarmPart(EvidencePart):
    """Alarm, and the event that began this occurrence of the alarm."""

    id: Annotated[str, Field(examples=["U1:UJB:film_stiffness"])]
    """Identifier of the alarm."""

    unit: Annotated[str, Field(examples=["U1"])]
    """Unit; "plant" for alarms about the service itself."""

    subject: Annotated[str, Field(examples=["UJB"])]
    """Bearing, channel or component of the alarm."""

    kind: Annotated[str, Field(examples=["film_stiffness"])]
    """Kind of alarm."""

    directions: str
    """Directions in which the limit was exceeded, as "xy"; empty for an alarm without them."""

    occurrence: int
    """Number of the occurrence, which counts how often the alarm was raised or escalated."""

    change: Annotated[str, Field(examples=["raised"])]
    """Change of the alarm: raised or escalated."""

    level: Annotated[AlarmLevelName, ByName] | None
    """Alarm level after the event; null without a level."""

    state: Annotated[str, Field(examples=["unacknowledged"])]
    """State of the alarm after the event."""

    time: Time
    """Time of the event."""

    time_ns: int
    """Time of the event, in nanoseconds since 1970 UTC."""

    value: Finite
    """Value compared with the limit, or null; for film alarms the mean change in percent."""

    limit: Finite
    """Limit of the alarm; null for an alarm without a limit."""

    value_unit: str | None
    """Unit of measurement of value and limit; null without a unit."""

    reason: Annotated[str, Field(examples=["film"])]
    """Reason of the event, as a single word."""


class UnitPart(EvidencePart):
    """Generating unit at the time of the alarm."""

    id: Annotated[str, Field(examples=["U1"])]
    """Identifier of the unit."""

    name: str
    """Name of the unit; may be empty."""

    link: Annotated[str, Field(examples=["connected"])]
    """State of the link to the source of the samples."""

    link_reason: str | None
    """Reason why samples do not arrive; null if they arrive."""

    last_sample: Time | None
    """Time of the newest sample by the device's clock; null without a sample."""


class FilePart(EvidencePart):
    """Size and checksum of one file of the bundle."""

    size: int
    """Size in bytes."""

    sha256: Sha256
    """SHA-256 of the content of the file."""


class Evidence(EvidencePart):
    """Evidence document: state of a unit when an alarm was raised or escalated."""

    format: Literal["padwatch-evidence"]
    """Name of the format."""

    version: Literal[1]
    """Version of the format."""

    made_by: Annotated[str, Field(examples=["padwatch 0.1.0"])]
    """Program that wrote the document, with its version."""

    origin: Literal["live", "replay"]
    """Origin of the data: a live machine, or a replayed recording."""

    plant: Annotated[str, Field(examples=["Itaipu"])]
    """Name of the plant."""

    taken: Time
    """Host time at which the state was recorded."""

    configuration: Sha256
    """Version of the configuration, a hash that is also the name of its file."""

    alarm: AlarmPart
    """Alarm, and the event that began this occurrence."""

    unit: UnitPart | None
    """Generating unit; null for alarms about the service itself."""

    bearing: str | None
    """Identifier of the bearing of the alarm; null if the alarm concerns no bearing."""

    direction: Direction | None
    """Direction of the alarm, for a film that of the larger change; null without a direction."""

    bearings: list[BearingPart]
    """All bearings of the unit; the bearing of the alarm comes first."""

    comparisons: list[ComparisonPart]
    """Comparisons of the films of the alarm's bearing with their baselines."""

    limits: dict[str, Any]
    """Settings in force, as in the plant file: alarms, films, analysis and the bearing."""

    missing: list[str]
    """Sentences about missing data."""

    samples_expected: bool
    """Whether the samples around the alarm were to be recorded."""

    files: dict[str, FilePart]
    """Other files of the bundle by name, except files added after the document."""

    sha256: Sha256
    """SHA-256 of this document without this key: keys sorted, no spaces, UTF-8."""


def file_part(path: Path) -> FilePart:
    """Read a file and return its size and checksum.

    Raises `OSError` if the file cannot be read.
    """
    hashed, size = hashlib.sha256(), 0
    with path.open("rb") as file:
        while chunk := file.read(CHUNK):
            hashed.update(chunk)
            size += len(chunk)
    return FilePart(size=size, sha256=hashed.hexdigest())


@dataclass(frozen=True)
class Maker:
    """Plant file, configuration and program, as stated in each bundle.

    Parameters
    ----------
    made_by
        Program and its version; without the names of host and user, for privacy.
    origin
        Origin of the data: a live machine or a replayed recording.
    """

    plant: PlantFile
    configuration: Configuration
    made_by: str
    origin: Origin


def sealed(document: dict[str, Any]) -> bytes:
    """Return the fields of an `Evidence` as JSON (UTF-8), with their SHA-256 as key ``sha256``."""
    blank = Evidence(**document, sha256="0" * 64)
    content = blank.model_dump(mode="json", by_alias=True)
    content.pop("sha256")
    whole = blank.model_copy(update={"sha256": hashlib.sha256(canonical(content)).hexdigest()})
    return (whole.model_dump_json(by_alias=True, indent=1) + "\n").encode()


def composed(snapshot: Snapshot, maker: Maker) -> dict[str, Any]:
    """Return the fields of an evidence document that depend on the snapshot alone."""
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
        "limits": _limits(snapshot, maker.plant),
        "samples_expected": snapshot.samples_expected,
    }


def _alarm(snapshot: Snapshot) -> AlarmPart:
    event, identity = snapshot.event, snapshot.event.identity
    return AlarmPart.of(
        event,
        identity,
        state=event.state_after,
        value_unit=value_unit(identity.kind),
        reason=str(event.reason),
    )


def _unit(snapshot: Snapshot, plant: PlantFile) -> UnitPart | None:
    status, id_ = snapshot.status, snapshot.event.identity.unit
    if status is None:
        return None
    return UnitPart.of(
        status,
        id=id_,
        name=next((unit.name for unit in plant.unit if unit.id == id_), ""),
        link=status.state,
        link_reason=status.reason,
    )


def _direction(snapshot: Snapshot) -> Direction | None:
    kind, own = snapshot.event.identity.kind, snapshot.bearings.get(snapshot.bearing or "")
    if kind == FILM_STIFFNESS and own is not None and own.film is not None:
        found = own.film.findings[own.film.worst]
        return AXES[QUANTITIES[found.quantity].row]
    if kind.endswith("_x"):
        return "x"
    return "y" if kind.endswith("_y") else None


def _limits(snapshot: Snapshot, plant: PlantFile) -> dict[str, Any]:
    rules = snapshot.rules
    found: dict[str, Any] = {
        "alarms": plant.alarms.model_dump(mode="json"),
        "analysis": plant.analysis.model_dump(mode="json"),
    }
    if rules is not None:
        found["films"] = plant.films.model_dump(mode="json")
        found["estimators"] = {each: name.value for each, name in rules.estimators.items()}
    id_ = snapshot.event.identity.unit
    bearings = [bearing for unit in plant.unit if unit.id == id_ for bearing in unit.bearing]
    own = (each.model_dump(mode="json") for each in bearings if each.id == snapshot.bearing)
    found["bearing"] = next(own, None)
    shown: dict[str, Any] = without_secrets(found)
    return shown


def not_known(snapshot: Snapshot) -> list[str]:
    """Return sentences about data that were missing at the time of the alarm; empty if none."""
    own = snapshot.bearings.get(snapshot.bearing or "")
    found = [
        f"bearing {each} had no result yet"
        for each, known in snapshot.bearings.items()
        if known.assessment is None
    ]
    if own is not None and snapshot.rules is not None and own.film is None:
        found.append("no reading of the film had been judged since the service started")
    return found
