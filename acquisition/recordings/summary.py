"""Summary of a recording: gaps, device restarts and rejected samples, counted from its blocks."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acquisition.recordings.messages import Progress
from acquisition.recordings.reader import Recording
from core.samples.gaps import Gap
from core.units import ns_from_s

MAX_GAPS_LISTED = 1000


@dataclass(frozen=True)
class RecordingSummary:
    """Summary of a recording; all numbers of samples are exact and per channel.

    Parameters
    ----------
    start_ns
        Time of the first sample, UTC in ns since 1970.
    stop_ns
        End of the last sample period, UTC in ns since 1970.
    n_samples
        Number of recorded samples.
    n_passed
        Total number of recorded, missing and rejected samples.
    gaps
        First thousand gaps in order of time.
    n_gaps
        Number of all gaps.
    n_gap_samples
        Number of samples missing in all gaps, without rejected samples.
    rejected
        Number of rejected samples by reason.
    epochs
        Epochs in order of time; several if the device restarted.
    n_not_ok
        Number of samples by channel id in blocks where the device reported the channel as not OK;
        without channels that were always OK.
    """

    start_ns: int
    stop_ns: int
    n_samples: int
    n_passed: int
    gaps: tuple[Gap, ...]
    n_gaps: int
    n_gap_samples: int
    rejected: Mapping[str, int]
    epochs: tuple[int, ...]
    n_not_ok: Mapping[str, int]


def summary_of(recording: Recording) -> RecordingSummary:
    """Return the summary of a recording, from the headers of all its blocks.

    Raises ConfigError if a file of the recording has become unreadable.
    """
    manifest, progress = recording.manifest, Progress()
    channels = np.arange(len(manifest.channels))[:, np.newaxis]
    start_ns: int | None = None
    stop_ns = n_gaps = n_gap_samples = 0
    gaps: list[Gap] = []
    epochs: list[int] = []
    rejected: Counter[str] = Counter()
    n_not_ok = np.zeros(len(channels), dtype=np.int64)
    for heads, rejections in recording.heads():
        continues, n_missing = progress.missing(heads)
        n_lost = np.where(continues, n_missing, 0)
        for row, before in rejections.items():
            n_lost[row] -= sum(rejection.n_samples for rejection in before)
            rejected.update({rejection.reason: rejection.n_samples for rejection in before})
        rows = np.flatnonzero(n_lost > 0)
        for row in rows[: MAX_GAPS_LISTED - len(gaps)].tolist():
            epoch, index, time_ns, *_ = heads[row].item()
            gaps.append(Gap(epoch, index - int(n_missing[row]), int(n_lost[row]), time_ns))
        n_gaps, n_gap_samples = n_gaps + rows.size, n_gap_samples + int(n_lost[rows].sum())
        epochs += heads["epoch"][~continues].tolist()
        n_not_ok += ((heads["ok"] >> channels & 1 == 0) * heads["n_samples"]).sum(axis=1)
        start_ns = int(heads["start_ns"][0]) if start_ns is None else start_ns
        last_s = int(heads["n_samples"][-1]) / manifest.rate_hz
        stop_ns = int(heads["start_ns"][-1]) + ns_from_s(last_s)
        progress = progress.after(heads, rejections, len(channels))
    return RecordingSummary(
        start_ns=start_ns or 0,
        stop_ns=stop_ns,
        n_samples=progress.n_samples,
        n_passed=progress.n_samples + n_gap_samples + rejected.total(),
        gaps=tuple(gaps),
        n_gaps=n_gaps,
        n_gap_samples=n_gap_samples,
        rejected=dict(rejected),
        epochs=tuple(epochs),
        n_not_ok={c.id: int(n) for c, n in zip(manifest.channels, n_not_ok, strict=True) if n},
    )
