"""`Evidence`: the document of a bundle, strict and with a version."""

import hashlib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from service.reports.parts import (
    BearingPart,
    ComparisonPart,
    Direction,
    EvidencePart,
    LevelWord,
    Moment,
    Sha256,
)
from service.runtime.files import CHUNK

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
