"""What happened in a recording: its gaps, restarts and rejections, counted from its blocks."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from acquisition.recordings.reader import BlockHead, Recording
from core.samples.gaps import Gap
from core.units import ns_from_s

MAX_GAPS_LISTED = 1000


@dataclass(frozen=True)
class RecordingSummary:
    """Counts are of samples per channel, and exact.

    Parameters
    ----------
    start_ns, stop_ns
        Time of the first sample and of the first one after the last.
    n_passed
        Recorded, gaps and rejected ones within an epoch.
    gaps
        The first thousand, in order of time.
    n_gaps, n_gap_samples
        All of them; without what was rejected.
    epochs
        In order of time; more than one if the device began to count anew.
    n_not_ok
        Samples of each channel, by id, in blocks in which the device called it not OK.
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
    """Go through all blocks of a recording.

    Raises
    ------
    ConfigError
        If they cannot be read any more.
    """
    count = _Count()
    for head in recording.heads():
        count.take(head)
    return count.summary(recording)


class _Count:
    def __init__(self) -> None:
        self._first: BlockHead | None = None
        self._last: BlockHead | None = None
        self._gaps: list[Gap] = []
        self._n_gaps = self._n_gap_samples = self._n_samples = 0
        self._rejected: Counter[str] = Counter()
        self._n_not_ok: Counter[int] = Counter()
        self._epochs: list[int] = []

    def take(self, head: BlockHead) -> None:
        last, self._last = self._last, head
        self._first = self._first or head
        if last is None or head.epoch != last.epoch:
            self._epochs.append(head.epoch)
        else:
            self._note_missing(head, head.first_index - last.first_index - last.n_samples)
        self._n_samples += head.n_samples
        for rejection in head.rejected:
            self._rejected[rejection.reason] += rejection.n_samples
        for number, ok in enumerate(head.ok):
            self._n_not_ok[number] += 0 if ok else head.n_samples

    def _note_missing(self, head: BlockHead, n_missing: int) -> None:
        n_gap = n_missing - sum(rejection.n_samples for rejection in head.rejected)
        if n_gap > 0:
            gap = Gap(head.epoch, head.first_index - n_missing, n_gap, head.start_ns)
            self._gaps += [gap] if self._n_gaps < MAX_GAPS_LISTED else []
            self._n_gaps += 1
            self._n_gap_samples += n_gap

    def summary(self, recording: Recording) -> RecordingSummary:
        rate_hz, ids = recording.manifest.rate_hz, [c.id for c in recording.manifest.channels]
        first, last = self._first, self._last
        return RecordingSummary(
            start_ns=first.start_ns if first else 0,
            stop_ns=last.start_ns + ns_from_s(last.n_samples / rate_hz) if last else 0,
            n_samples=self._n_samples,
            n_passed=self._n_samples + self._n_gap_samples + self._rejected.total(),
            gaps=tuple(self._gaps),
            n_gaps=self._n_gaps,
            n_gap_samples=self._n_gap_samples,
            rejected=dict(self._rejected),
            epochs=tuple(self._epochs),
            n_not_ok={ids[n]: count for n, count in sorted(self._n_not_ok.items()) if count},
        )
