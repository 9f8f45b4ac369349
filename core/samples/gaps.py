"""Where every offered sample went: gaps, outages, restarts, and counts that begin again.

If a device continues its count, missing samples are counted by index, exactly. If it restarts the
count, their number is estimated from times and marked as an estimate.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from core.samples.axis import RECOUNTED_EPOCHS, ClockTolerance
from core.samples.blocks import Rejection, SampleBlock
from core.units import NS_PER_S, ns_from_s

_TOLERANCE = ClockTolerance()
_SECONDS = 1 << 32


@dataclass(frozen=True)
class Gap:
    """Samples that were not delivered, per channel: exact where the device has counted them.

    Parameters
    ----------
    stop_ns
        Time of the first sample after the gap.
    start_ns
        Time of the first sample that is missing; None where it follows from the number.
    is_estimated
        Whether the number follows from the times: the device counted anew, or counts nothing.
    """

    epoch: int
    first_index: int
    n_samples: int
    stop_ns: int
    start_ns: int | None = None
    is_estimated: bool = False


@dataclass(frozen=True)
class SampleAccount:
    """Samples per channel since the first block: offered = stored + flagged + gap + rejected.

    Parameters
    ----------
    n_flagged
        Held like the stored ones, but at least one channel was not good with them.
    n_repeated
        Offered a second time and dropped; not part of the balance.
    n_restarts
        How often the device began to count anew. What it measured between the last sample that
        arrived and its restart is unknown.
    """

    n_stored: int = 0
    n_flagged: int = 0
    n_gap: int = 0
    n_repeated: int = 0
    n_restarts: int = 0
    rejected: Mapping[str, int] = field(default_factory=dict)

    @property
    def n_offered(self) -> int:
        """What the device has counted."""
        return self.n_stored + self.n_flagged + self.n_gap + sum(self.rejected.values())

    def with_taken(self, n_samples: int, n_flagged: int, n_repeated: int) -> "SampleAccount":
        """Add the samples of one block; so many of them have a channel that is not good."""
        return replace(
            self,
            n_stored=self.n_stored + n_samples - n_flagged,
            n_flagged=self.n_flagged + n_flagged,
            n_repeated=self.n_repeated + n_repeated,
        )

    def with_missing(self, n_missing: int, rejections: Iterable[Rejection]) -> "SampleAccount":
        """Add what is missing before a block; what was rejected beyond that was offered before."""
        if not n_missing:
            return self
        rejected = dict(self.rejected)
        for rejection in rejections:
            n_rejected = max(0, min(rejection.n_samples, n_missing))
            n_missing -= n_rejected
            if n_rejected:
                rejected[rejection.reason] = rejected.get(rejection.reason, 0) + n_rejected
        return replace(self, n_gap=self.n_gap + n_missing, rejected=rejected)


@dataclass(frozen=True)
class Reach:
    """How far the stored samples of a unit reach: the first sample after them, and its time.

    Gaps are those already recorded after it, oldest first.
    """

    epoch: int
    stop_index: int
    stop_ns: int
    gaps: Sequence[Gap] = ()


def outage(reach: Reach, block: SampleBlock) -> list[Gap]:
    """Return what is missing between the stored samples and the first block after them.

    There is one gap for every stretch that is not recorded yet; none if the block follows on what
    is stored or repeats it.
    """
    if _goes_on(reach, block):
        return list(_counted(reach, block))
    return _estimated(reach, block)


def restart(reach: Reach, block: SampleBlock) -> Gap | None:
    """Return what is missing between the last sample that arrived and the restart of its device.

    It is None if by the device's clock nothing is; what was counted since is no part of it.
    """
    stop_ns = _begin_ns(block) if n_missed(reach.stop_ns, block) else block.start_ns
    lost = _lost(reach, reach.stop_ns, stop_ns, block.rate_hz)
    return lost if lost.n_samples else None


def begins_anew(reach: Reach, block: SampleBlock) -> bool:
    """Whether a block that is old by its index is new by its time.

    Then it is no repetition: the device has begun to count again, in the same epoch.
    """
    if block.epoch != reach.epoch or block.first_index >= reach.stop_index:
        return False
    return block.start_ns - reach.stop_ns >= -_TOLERANCE.over(0) and not _goes_on(reach, block)


def n_missed(stop_ns: int, block: SampleBlock) -> int:
    """Samples of a new count that were not delivered, before the first block of it.

    A count that by its index began before `stop_ns`, up to which samples of earlier counts have
    arrived, does not show what is missing: it did not begin then, as a counter that went on or has
    wrapped.
    """
    counted_ns = ns_from_s(block.first_index / block.rate_hz)
    return block.first_index if _begin_ns(block) - stop_ns >= -_TOLERANCE.over(counted_ns) else 0


def _goes_on(reach: Reach, block: SampleBlock) -> bool:
    """Whether index and time agree that it is the same count, still running."""
    if block.epoch != reach.epoch:
        return False
    passed_ns = ns_from_s((block.first_index - reach.stop_index) / block.rate_hz)
    deviation_ns = abs(block.start_ns - reach.stop_ns - passed_ns)
    poll_ns = ns_from_s(2.0 / block.rate_hz)  # where a sample is a poll, this may be a minute
    return deviation_ns <= poll_ns + _TOLERANCE.over(passed_ns)


def _counted(reach: Reach, block: SampleBlock) -> Iterator[Gap]:
    """The stretches up to the block that no gap of this count covers."""
    at = reach.stop_index
    for gap in sorted(reach.gaps, key=lambda gap: gap.first_index):
        if gap.epoch != reach.epoch or _is_older(gap, reach):
            continue
        if at < gap.first_index < block.first_index:
            yield _piece(block, at, gap.first_index)
        at = max(at, gap.first_index + gap.n_samples)
    if at < block.first_index:
        yield _piece(block, at, block.first_index)


def _is_older(gap: Gap, reach: Reach) -> bool:
    """Whether a gap is of an earlier count of the same epoch, that had come farther."""
    return gap.stop_ns - reach.stop_ns < -_TOLERANCE.over(0)


def _piece(block: SampleBlock, start: int, stop: int) -> Gap:
    def time_ns(index: int) -> int:
        return block.start_ns - ns_from_s((block.first_index - index) / block.rate_hz)

    return Gap(block.epoch, start, stop - start, time_ns(stop), time_ns(start))


def _estimated(reach: Reach, block: SampleBlock) -> list[Gap]:
    """From the end of the old count to the beginning of the new one, and what that has missed."""
    start_ns = max([reach.stop_ns, *(gap.stop_ns for gap in reach.gaps if gap.is_estimated)])
    begin_ns = _begin_ns(block)
    if block.epoch == reach.epoch or begin_ns < start_ns or block.first_index == 0:
        return [_lost(reach, start_ns, block.start_ns, block.rate_hz)]
    lost = _lost(reach, start_ns, begin_ns, block.rate_hz)
    return [lost, _piece(block, 0, block.first_index)]


def _begin_ns(block: SampleBlock) -> int:
    """When the device began to count, by this block."""
    return block.start_ns - ns_from_s(block.first_index / block.rate_hz)


def _lost(reach: Reach, start_ns: int, stop_ns: int, rate_hz: float) -> Gap:
    n_samples = max(0, round((stop_ns - start_ns) / NS_PER_S * rate_hz))
    start_ns = min(start_ns, stop_ns)  # a clock may have been put back
    return Gap(reach.epoch, reach.stop_index, n_samples, stop_ns, start_ns, is_estimated=True)


@dataclass(frozen=True)
class Count:
    """The count that a unit is in.

    Parameters
    ----------
    reported
        Its epoch as blocks name it.
    epoch
        As everything downstream names it.
    stop_index, stop_ns
        Of the first sample after those that have arrived.
    """

    reported: int
    epoch: int
    stop_index: int
    stop_ns: int


class Counts:
    """Gives another number to a count that a device begins again in the same epoch.

    A device may begin its count again without reporting it, and so may a program that reads it. By
    the index alone, all that it then delivers has been there; its time shows that it is new. The
    count is None before the first block.
    """

    def __init__(self) -> None:
        self.count: Count | None = None

    def restore(self, count: Count | None) -> None:
        """Go on in a count that began before a restart of padwatch."""
        self.count = count

    def replayed(self, block: SampleBlock) -> SampleBlock:
        """A block that was taken before, in the count that it belonged to."""
        if self.count is None or block.epoch != self.count.reported:
            return block
        return _in(block, self.count.epoch)

    def placed(self, block: SampleBlock) -> SampleBlock:
        """The next block, in the count that it belongs to."""
        count = self.count
        epoch, is_new = block.epoch, True
        if count is not None and block.epoch == count.reported:
            anew = begins_anew(Reach(block.epoch, count.stop_index, count.stop_ns), block)
            epoch = (
                RECOUNTED_EPOCHS + block.start_ns // NS_PER_S % _SECONDS if anew else count.epoch
            )
            is_new = anew or block.stop_index >= count.stop_index
        if is_new:
            self.count = Count(block.epoch, epoch, block.stop_index, block.stop_ns)
        return _in(block, epoch)


def _in(block: SampleBlock, epoch: int) -> SampleBlock:
    return block if block.epoch == epoch else replace(block, epoch=epoch)
