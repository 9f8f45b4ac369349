"""Summary of a recording: gaps, device restarts and rejected samples, counted from its blocks."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from acquisition.recordings.messages import BlockHead
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

    Raises
    ------
    ConfigError
        If a file of the recording has become unreadable.
    """
    rate_hz, ids = recording.manifest.rate_hz, [c.id for c in recording.manifest.channels]
    first: BlockHead | None = None
    last: BlockHead | None = None
    gaps: list[Gap] = []
    epochs: list[int] = []
    n_gaps = n_gap_samples = n_samples = 0
    rejected: Counter[str] = Counter()
    n_not_ok: Counter[int] = Counter()
    for head in recording.heads():
        if last is None or head.epoch != last.epoch:
            epochs.append(head.epoch)
        elif (gap := _gap(last, head)).n_samples > 0:
            gaps += [gap] if n_gaps < MAX_GAPS_LISTED else []
            n_gaps += 1
            n_gap_samples += gap.n_samples
        n_samples += head.n_samples
        for rejection in head.rejected:
            rejected[rejection.reason] += rejection.n_samples
        n_not_ok.update({n: head.n_samples for n, ok in enumerate(head.ok) if not ok})
        first, last = first or head, head
    return RecordingSummary(
        start_ns=first.start_ns if first else 0,
        stop_ns=last.start_ns + ns_from_s(last.n_samples / rate_hz) if last else 0,
        n_samples=n_samples,
        n_passed=n_samples + n_gap_samples + rejected.total(),
        gaps=tuple(gaps),
        n_gaps=n_gaps,
        n_gap_samples=n_gap_samples,
        rejected=dict(rejected),
        epochs=tuple(epochs),
        n_not_ok={ids[n]: count for n, count in sorted(n_not_ok.items())},
    )


def _gap(last: BlockHead, head: BlockHead) -> Gap:
    """Return the gap between two blocks of an epoch, without rejected samples; it may be empty."""
    n_missing = head.first_index - last.first_index - last.n_samples
    n_rejected = sum(rejection.n_samples for rejection in head.rejected)
    return Gap(head.epoch, head.first_index - n_missing, n_missing - n_rejected, head.start_ns)
