"""Metrics of recorded samples and of stored recordings."""

from service.recordings.around_alarms import Captures
from service.recordings.continuous_recorder import ContinuousRecorder
from service.recordings.keeper import RecordingIndexer
from service.runtime.metrics import Families

RECORDINGS = {
    "recording_samples_total": "This counts the samples per channel that continuous recording has"
    " synced to the disk.",
    "recording_shed_samples_total": "This counts the samples per channel that are missing from"
    " continuous recordings, by reason.",
    "captures_written_total": "This counts the captures of samples around alarms.",
    "captures_failed_total": "This counts the failed attempts to write a capture.",
    "captures_running": "This is the number of captures that are being made.",
    "recordings_adopted_total": "This counts the recordings that were added to the index.",
    "recordings_checked_total": "This counts the recordings that were read again.",
    "recordings_damaged_total": "This counts the recordings that were found damaged.",
    "recordings_missing_total": "This counts the recordings that were found missing.",
    "recordings_removed_total": "This counts the recordings that were removed to free space.",
    "recordings_files": "This is the number of recordings on the disk.",
    "recordings_bytes": "This is the size of the recordings on the disk.",
}


def add_recordings(
    families: Families,
    recorder: ContinuousRecorder,
    captures: Captures,
    recordings: RecordingIndexer,
) -> None:
    """Add the metrics of recorded and dropped samples, captures and recordings to `families`."""
    families.declare(RECORDINGS)
    families.add("recording_samples_total", recorder.n_written)
    for reason, n_samples in sorted(recorder.n_dropped.items()):
        families.add("recording_shed_samples_total", n_samples, reason=reason.value)
    families.add("captures_written_total", captures.n_written)
    families.add("captures_failed_total", captures.n_failed)
    families.add("captures_running", captures.n_running)
    found = recordings.found
    families.add("recordings_adopted_total", found.n_adopted)
    families.add("recordings_checked_total", found.n_checked)
    families.add("recordings_damaged_total", found.n_damaged)
    families.add("recordings_missing_total", found.n_missing)
    for removed, n_files in sorted(found.n_removed.items()):
        families.add("recordings_removed_total", n_files, kind=removed)
    for kind, n_files in recordings.n_files.items():
        families.add("recordings_files", n_files, kind=kind.value)
        families.add("recordings_bytes", recordings.n_bytes[kind], kind=kind.value)
