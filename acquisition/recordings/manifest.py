"""Manifest of a recording: unit, calibration and files; limits of the recording format."""

import hashlib
import json
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError
from pydantic import model_validator as validated

from acquisition.delivery.small_file import read_small_file
from acquisition.errors import ConfigError
from core.machine.channel import Measurand
from core.samples.calibration import (
    BLOCK_SAMPLES,
    ChannelCalibration,
    SlowCalibration,
    UnitCalibration,
)

FORMAT = "padwatch-recording"
VERSION = 3
MANIFEST = "manifest.json"
SAMPLES = "samples.parquet"
BLOCKS = "blocks.parquet"

MAX_CHANNELS = 32
MAX_SLOW_CHANNELS = 50

ROWS_PER_GROUP = 131_072
"""Samples per channel in a Parquet row group: 1 MB for four channels."""

BLOCKS_PER_GROUP = 8192

MAX_BLOCK_SAMPLES = ROWS_PER_GROUP

MAX_SAMPLES = 2**29
"""Maximum number of samples per channel in a recording: ten days at 600 Hz."""

MAX_INDEX = 2**53
"""Maximum sample index and maximum epoch number; exact in double precision."""

MAX_REJECTIONS = 32
"""Maximum number of rejection entries, one per reason, before a block."""

MAX_REASON_LENGTH = 64

MAX_MANIFEST_BYTES = 1_000_000

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,31}$")]
Sha256 = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
FileName = Literal["samples.parquet", "blocks.parquet"]
SampleType = Literal["int16", "float32"]


class ManifestPart(BaseModel):
    """Base model of the manifest: frozen, without unknown keys, NaN or infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class RecordedChannel(ManifestPart):
    """Recorded waveform channel; its measurand determines its engineering unit.

    Calibration fields are those of :class:`core.samples.calibration.ChannelCalibration`.
    """

    id: Name
    measurand: Measurand
    full_scale_v: Annotated[float, Field(gt=0.0)]
    unit_per_v: float
    ok_min_v: float
    ok_max_v: float


class RecordedSlowChannel(ManifestPart):
    """Recorded slow channel, with the unit and the plausible range of its values."""

    id: Name
    unit: Annotated[str, StringConstraints(min_length=1, max_length=16)]
    minimum: float
    maximum: float


class RecordedUnit(ManifestPart):
    """Generating unit whose samples are recorded; channels are in the order of the columns.

    Parameters
    ----------
    sample_type
        "int16": counts of an A/D converter. "float32": engineering units from a device without
        counts; NaN for a missing sample.
    block_samples
        Number of samples that share one OK state per channel and one set of slow values.

    Raises
    ------
    ValueError
        If two channels have the same id, or a value exceeds its limits.
    """

    unit: Name
    rate_hz: Annotated[float, Field(gt=0.0, le=1e6)]
    channels: Annotated[tuple[RecordedChannel, ...], Field(min_length=1, max_length=MAX_CHANNELS)]
    slow_channels: Annotated[tuple[RecordedSlowChannel, ...], Field(max_length=MAX_SLOW_CHANNELS)]
    sample_type: SampleType = "int16"
    block_samples: Annotated[int, Field(ge=1, le=MAX_BLOCK_SAMPLES)] = BLOCK_SAMPLES

    @validated(mode="after")
    def _check(self) -> Self:
        ids = [c.id for c in self.channels] + [c.id for c in self.slow_channels]
        twice = {id_ for id_ in ids if ids.count(id_) > 1}
        if twice:
            raise ValueError(f"channel {min(twice)!r} occurs twice; ids must be unique")
        return self

    @property
    def calibration(self) -> UnitCalibration:
        """Calibration at the time of the recording."""
        return UnitCalibration(
            unit=self.unit,
            rate_hz=self.rate_hz,
            channels=tuple(
                ChannelCalibration(c.full_scale_v, c.unit_per_v, c.ok_min_v, c.ok_max_v)
                for c in self.channels
            ),
            slow=tuple(SlowCalibration(c.id, c.minimum, c.maximum) for c in self.slow_channels),
            block_samples=self.block_samples,
        )


class RecordedFile(ManifestPart):
    """Expected size and checksum of a file of the recording."""

    size: Annotated[int, Field(ge=1, le=2**50)]
    sha256: Sha256


class Manifest(RecordedUnit):
    """Contents of ``manifest.json``.

    Parameters
    ----------
    start
        Time of the first sample as text, for information; readers use the times of the blocks.
    made_by
        Program and person that made the recording.
    n_samples
        Number of samples per channel.
    files
        All other files of the recording by name.
    checksum
        SHA-256 of all other values; see :func:`checksum_of`.
    """

    format: Literal["padwatch-recording"]
    version: Literal[3]
    made_by: Annotated[str, StringConstraints(max_length=200)]
    start: Annotated[str, StringConstraints(pattern=r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{9}Z$")]
    n_blocks: Annotated[int, Field(ge=1, le=MAX_SAMPLES)]
    n_samples: Annotated[int, Field(ge=1, le=MAX_SAMPLES)]
    files: Annotated[dict[FileName, RecordedFile], Field(min_length=2)]
    checksum: Sha256 | None = None


class _Head(BaseModel):
    """Keys that every version of the manifest contains."""

    format: str
    version: int


def read_manifest(folder: Path) -> Manifest:
    """Read and check the manifest of a recording.

    Raises ConfigError if the manifest is missing or invalid; the message names the first error.
    """
    path = folder / MANIFEST
    if not folder.is_dir():
        raise ConfigError(f"{folder}: folder does not exist")
    if not path.is_file():
        raise ConfigError(f"{folder}: {MANIFEST} is missing; not a recording, or an unfinished one")
    try:
        text = read_small_file(path, MAX_MANIFEST_BYTES)
        head = _Head.model_validate_json(text, strict=True)
        if head.format != FORMAT or head.version != VERSION:
            raise ConfigError(
                f"{path}: format is {head.format[:40]!r} version {head.version},"
                f" expected {FORMAT!r} version {VERSION}"
            )
        found = Manifest.model_validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = "".join(f".{part}"[:60] for part in first["loc"]).lstrip(".")
        words = f"{place}: {first['msg']}" if place else first["msg"]
        raise ConfigError(f"{path}: {words}") from error
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    if found.checksum != checksum_of(json.loads(text)):
        raise ConfigError(f"{path}: checksum does not match; the file is damaged or was edited")
    return found


def manifest_text(manifest: Manifest) -> str:
    """Return the text of the manifest file: format and version first, checksum last."""
    values = manifest.model_dump(mode="json", exclude={"checksum"})
    first = {name: values[name] for name in ("format", "version", "made_by", "start")}
    return json.dumps(first | values | {"checksum": checksum_of(values)}, indent=1) + "\n"


def checksum_of(document: dict[str, object]) -> str:
    """Return the SHA-256 of a manifest without its checksum, independent of order and spacing."""
    rest = {name: value for name, value in document.items() if name != "checksum"}
    text = json.dumps(rest, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode("ascii")).hexdigest()
