"""Metrics of continuous recording and of stored recordings."""

from collections.abc import Iterator

from prometheus_client.metrics_core import Metric

from service.recordings.continuous_recorder import ContinuousRecorder
from service.recordings.keeper import RecordingIndexer
from service.runtime.metrics import counter, gauge


def recording_metrics(
    recorder: ContinuousRecorder | None, recordings: RecordingIndexer | None
) -> Iterator[Metric]:
    """Yield the metric families of recorded samples, dropped samples and stored recordings."""
    if recorder is not None:
        yield counter(
            "recording_samples",
            "Samples per channel that continuous recording has synced to the disk.",
            (),
            [((), recorder.n_written)],
        )
        yield counter(
            "recording_shed_samples",
            "Samples per channel missing from continuous recordings, by reason.",
            ("reason",),
            [((reason.value,), n) for reason, n in sorted(recorder.n_dropped.items())],
        )
    if recordings is None:
        return
    found = recordings.found
    for name, meaning, number in (
        ("recordings_adopted", "Recordings added to the index.", found.n_adopted),
        ("recordings_checked", "Recordings that were read again.", found.n_checked),
        ("recordings_damaged", "Recordings that were found damaged.", found.n_damaged),
        ("recordings_missing", "Recordings that were found missing.", found.n_missing),
    ):
        yield counter(name, meaning, (), [((), number)])
    removed = [((kind,), n) for kind, n in sorted(found.n_removed.items())]
    yield counter("recordings_removed", "Recordings removed to free space.", ("kind",), removed)
    for name, meaning, numbers in (
        ("recordings_files", "Recordings on the disk.", recordings.n_files),
        ("recordings_bytes", "Size of the recordings on the disk.", recordings.n_bytes),
    ):
        yield gauge(name, meaning, ("kind",), [((k.value,), n) for k, n in numbers.items()])
