"""What the API answers about recordings of samples."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.channel_models import ChannelUnit
from service.api.models import ApiModel, Time


class RecordingAlarmModel(ApiModel):
    """What a recording was made for."""

    alarm: Annotated[str, Field(examples=["U1:UJB:shaft_x"])]
    """Identifier of the alarm."""

    occurrence: int
    """Which occurrence of it."""

    change: Annotated[str, Field(examples=["raised"])]
    """What happened to it."""

    level: str | None
    """Level that it had then."""

    time: Time
    """When."""


class RunningRecordingModel(ApiModel):
    """An occurrence of an alarm whose samples are still being written."""

    alarm: Annotated[str, Field(examples=["U1:UJB:shaft_x"])]
    """Identifier of the alarm."""

    occurrence: int
    """Which occurrence of it."""


class RecordingModel(ApiModel):
    """A finished recording."""

    id: Annotated[str, Field(examples=["U1-20261121T090312.400Z-shaft_x"])]
    """Its name."""

    kind: Literal["capture", "continuous"]
    """Samples around an alarm, or a stretch of all samples."""

    state: Literal["complete", "damaged"]
    """Whether it is whole, as far as its manifest and the newest check tell."""

    reason: str | None
    """Why not."""

    unit: str | None
    """Unit; null if its manifest cannot be read, like all that follows but size and alarms."""

    start: Time | None
    """Time of the first sample."""

    duration_s: float | None
    """Length of its samples, holes left out."""

    rate_hz: float | None
    """Samples per second and channel."""

    n_samples: int | None
    """Of each channel."""

    n_bytes: int
    """Of all its files."""

    alarms: list[RecordingAlarmModel]
    """What it was made for; the first has begun it. None for a continuous recording."""


class RecordingsModel(ApiModel):
    """Recordings of samples around alarms, and of all samples where they are kept."""

    recordings: list[RecordingModel]
    """Finished ones, newest first."""

    being_made: list[RunningRecordingModel]
    """What is still being written."""

    error: str | None
    """Why samples around alarms are not kept just now; null if they are."""

    continuous: list[str]
    """Units of which all samples are recorded."""

    continuous_error: str | None
    """Why not all of them are just now; null if they are."""


class RecordedChannelModel(ApiModel):
    """A recorded waveform channel."""

    id: str
    """Identifier within the unit."""

    unit: ChannelUnit
    """Engineering unit."""

    n_not_ok: int
    """Samples in blocks in which the device called it not OK."""


class RecordedSlowModel(ApiModel):
    """A recorded slow channel."""

    id: str
    """Identifier within the unit."""

    unit: str
    """Unit of its readings."""


class RecordedFileModel(ApiModel):
    """A file of a recording."""

    size: int
    """Bytes."""

    sha256: str
    """Its checksum."""


class RecordingInfoModel(ApiModel):
    """All about a recording, which was checked from end to end for this."""

    recording: RecordingModel
    """As in the list."""

    made_by: str
    """Program, and what for."""

    sample_type: Literal["int16", "float32"]
    """Counts of the converter, or engineering units."""

    end: Time
    """Time of the first sample after the last."""

    n_gaps: int
    """Holes in the samples."""

    n_gap_samples: int
    """Samples that never arrived, per channel."""

    rejected: dict[str, int]
    """Samples that were refused, by reason."""

    epochs: list[int]
    """More than one if the device began to count anew."""

    channels: list[RecordedChannelModel]
    """Waveform channels in the order of the columns."""

    slow_channels: list[RecordedSlowModel]
    """Slow channels likewise."""

    files: dict[str, RecordedFileModel]
    """Its files, apart from the manifest and the alarms."""
