"""What is in a recording, for people and for programs."""

from collections.abc import Iterator
from typing import Any

from acquisition.delivery.units import UNIT_OF
from acquisition.recordings.reader import Recording
from acquisition.recordings.summary import RecordingSummary
from service.runtime.times import rfc3339

GAPS_PRINTED = 20


def json_of(recording: Recording, summary: RecordingSummary) -> dict[str, Any]:
    """All about a recording, for programs."""
    manifest = recording.manifest
    return {
        "folder": str(recording.folder),
        "unit": manifest.unit,
        "version": manifest.version,
        "made_by": manifest.made_by,
        "sample_type": manifest.sample_type,
        "rate_hz": manifest.rate_hz,
        "block_samples": manifest.block_samples,
        "start": rfc3339(summary.start_ns),
        "end": rfc3339(summary.stop_ns),
        "samples": summary.n_samples,
        "offered": summary.n_passed,
        "gaps": summary.n_gaps,
        "gap_samples": summary.n_gap_samples,
        "gap_list": [
            {
                "epoch": gap.epoch,
                "first_index": gap.first_index,
                "samples": gap.n_samples,
                "end": rfc3339(gap.stop_ns),
            }
            for gap in summary.gaps
        ],
        "rejected": dict(summary.rejected),
        "epochs": list(summary.epochs),
        "not_ok": dict(summary.n_not_ok),
        "channels": [
            channel.model_dump(mode="json") | {"unit": UNIT_OF[channel.measurand]}
            for channel in manifest.channels
        ],
        "slow_channels": [channel.model_dump(mode="json") for channel in manifest.slow_channels],
        "files": {name: file.model_dump() for name, file in manifest.files.items()},
    }


def lines_of(recording: Recording, summary: RecordingSummary) -> Iterator[str]:
    """All about a recording, for people."""
    manifest = recording.manifest
    yield f"{recording.folder}: unit {manifest.unit}, {manifest.sample_type}, {manifest.made_by}"
    yield f"  from         {rfc3339(summary.start_ns)}"
    yield f"  to           {rfc3339(summary.stop_ns)}"
    duration_s = summary.n_passed / manifest.rate_hz
    yield f"  length       {duration_s:.3f} s at {manifest.rate_hz:.9g} Hz"
    yield f"  samples      {summary.n_samples} of {summary.n_passed} per channel"
    yield from _losses(summary)
    for channel in manifest.channels:
        yield f"  channel      {channel.id:<32} {UNIT_OF[channel.measurand]}"
    for slow in manifest.slow_channels:
        yield f"  slow channel {slow.id:<32} {slow.unit}"
    for name, file in manifest.files.items():
        yield f"  {name:<16} {file.size} bytes, SHA-256 {file.sha256[:12]}…"


def _losses(summary: RecordingSummary) -> Iterator[str]:
    yield f"  gaps         {summary.n_gaps}, {summary.n_gap_samples} samples"
    for gap in summary.gaps[:GAPS_PRINTED]:
        yield f"    {gap.n_samples} samples from index {gap.first_index}, to {rfc3339(gap.stop_ns)}"
    if summary.n_gaps > GAPS_PRINTED:
        yield f"    and {summary.n_gaps - GAPS_PRINTED} more"
    for reason, n_samples in summary.rejected.items():
        yield f"  rejected     {n_samples} samples: {reason}"
    if len(summary.epochs) > 1:
        yield f"  restarts     {len(summary.epochs) - 1} of the device's sample count"
    for id_, n_samples in summary.n_not_ok.items():
        yield f"  not OK       {n_samples} samples of {id_}"
