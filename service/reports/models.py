"""What the API answers about evidence of alarms."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.values import ApiModel, Time


class OccurrenceModel(ApiModel):
    """One occurrence of an alarm with what there is of it."""

    occurrence: int
    """Counts how often the alarm was raised or rose in level."""

    change: Annotated[str, Field(examples=["raised"])]
    """raised or escalated."""

    level: Literal["alert", "danger"] | None
    """Level that it had since."""

    time: Time
    """When."""

    state: Literal["complete", "waiting", "lost", "removed", "not_kept"]
    """Whether there is evidence: complete, waiting for the disk, lost (by a crash, or a disk that
    refused for long), removed to make room, or never kept."""

    samples: Literal["complete", "being_made", "lost", "removed", "none"]
    """Whether the samples around the alarm are there: complete, being recorded, lost, removed to
    make room, or none for this alarm."""

    evidence: Annotated[
        str | None, Field(examples=["/api/v1/alarms/U1:UJB:stiffness_x/evidence/3"])
    ]
    """Path of the document; null unless complete. Add /report or /bundle.zip to it."""


class OccurrencesModel(ApiModel):
    """Occurrences of an alarm."""

    alarm: Annotated[str, Field(examples=["U1:UJB:stiffness_x"])]
    """Which alarm."""

    origin: Literal["live", "replay"]
    """Whether a machine is watched, or a recording played."""

    occurrences: list[OccurrenceModel]
    """Newest first."""
