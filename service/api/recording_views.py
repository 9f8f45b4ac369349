"""Recordings in the words of the API."""

from acquisition.errors import ConfigError
from service.api.channel_views import UNITS
from service.api.recording_models import (
    RecordedChannelModel,
    RecordedFileModel,
    RecordedSlowModel,
    RecordingAlarmModel,
    RecordingInfoModel,
    RecordingModel,
)
from service.recordings.library import Kept, Shelf
from service.runtime.times import rfc3339


def recording_model(kept: Kept) -> RecordingModel:
    """A recording as in the list."""
    manifest = kept.manifest
    return RecordingModel(
        id=kept.name,
        kind=kept.kind.value,
        state="complete" if kept.fault is None else "damaged",
        reason=kept.fault,
        unit=None if manifest is None else manifest.unit,
        start=None if manifest is None else manifest.start,
        duration_s=None if manifest is None else manifest.n_samples / manifest.rate_hz,
        rate_hz=None if manifest is None else manifest.rate_hz,
        n_samples=None if manifest is None else manifest.n_samples,
        n_bytes=kept.n_bytes,
        alarms=[RecordingAlarmModel(**each) for each in kept.alarms],
    )


def recording_info(shelf: Shelf, kept: Kept) -> RecordingInfoModel:
    """All about a recording.

    Raises
    ------
    ConfigError
        If it is damaged.
    """
    manifest = kept.manifest
    if manifest is None or kept.fault is not None:
        raise ConfigError(kept.fault or "its manifest cannot be read")
    summary = shelf.summary(kept.name)
    return RecordingInfoModel(
        recording=recording_model(kept),
        made_by=manifest.made_by,
        sample_type=manifest.sample_type,
        end=rfc3339(summary.stop_ns),
        n_gaps=summary.n_gaps,
        n_gap_samples=summary.n_gap_samples,
        rejected=dict(summary.rejected),
        epochs=list(summary.epochs),
        channels=[
            RecordedChannelModel(
                id=each.id, unit=UNITS[each.measurand], n_not_ok=summary.n_not_ok.get(each.id, 0)
            )
            for each in manifest.channels
        ],
        slow_channels=[RecordedSlowModel(id=e.id, unit=e.unit) for e in manifest.slow_channels],
        files={
            name: RecordedFileModel(size=file.size, sha256=file.sha256)
            for name, file in manifest.files.items()
        },
    )
