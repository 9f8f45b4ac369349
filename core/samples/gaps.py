"""Account of missing samples: gaps, outages, and restarts of the device's sample count.

If a device continues its sample count, missing samples are counted exactly by index. If it restarts
the count, their number is estimated from times and marked as an estimate.
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
    """Consecutive samples of a unit that are missing because they were lost or rejected.

    Parameters
    ----------
    epoch, first_index
        Epoch and index of the first missing sample.
    n_samples
        Number of missing samples per channel.
    stop_ns
        Time of the first sample after the gap, UTC nanoseconds since 1970.
    start_ns
        Time of the first missing sample; None if it follows from `n_samples` and `stop_ns`.
    is_estimated
        Whether `n_samples` is estimated from times, because the device restarted its sample count
        or does not count samples.
    """

    epoch: int
    first_index: int
    n_samples: int
    stop_ns: int
    start_ns: int | None = None
    is_estimated: bool = False


@dataclass(frozen=True)
class SampleAccount:
    """Balance of the samples per channel: offered = stored + flagged + gap + rejected.

    The account starts with the first block.

    Parameters
    ----------
    n_stored
        Samples received with all channels good.
    n_flagged
        Samples received and kept, with at least one channel not good.
    n_gap
        Samples lost before they were received.
    n_repeated
        Samples offered a second time and dropped; not part of the balance.
    n_restarts
        Number of restarts of the device's sample count. Samples lost between the last received
        sample and a restart are not counted.
    rejected
        Samples received but refused, by reason.
    """

    n_stored: int = 0
    n_flagged: int = 0
    n_gap: int = 0
    n_repeated: int = 0
    n_restarts: int = 0
    rejected: Mapping[str, int] = field(default_factory=dict)

    @property
    def n_offered(self) -> int:
        """Number of samples per channel that the device offered, without repeated samples."""
        return self.n_stored + self.n_flagged + self.n_gap + sum(self.rejected.values())

    def with_taken(self, n_samples: int, n_flagged: int, n_repeated: int) -> "SampleAccount":
        """Return the account with one block's samples added; `n_samples` includes `n_flagged`."""
        return replace(
            self,
            n_stored=self.n_stored + n_samples - n_flagged,
            n_flagged=self.n_flagged + n_flagged,
            n_repeated=self.n_repeated + n_repeated,
        )

    def with_missing(self, n_missing: int, rejections: Iterable[Rejection]) -> "SampleAccount":
        """Return the account with the samples missing before a block added.

        At most `n_missing` rejected samples are counted; any beyond that were offered before.
        """
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
    """End of the stored samples of a unit.

    Parameters
    ----------
    stop_index, stop_ns
        Index and time (UTC nanoseconds since 1970) of the first sample after the stored samples.
    gaps
        Gaps already recorded after this end, oldest first.
    """

    epoch: int
    stop_index: int
    stop_ns: int
    gaps: Sequence[Gap] = ()


def outage(reach: Reach, block: SampleBlock) -> list[Gap]:
    """Return the gaps between the stored samples and the first block after them.

    Recorded gaps (`reach.gaps`) are left out. The list is empty if the block continues or repeats
    the stored samples.
    """
    if _goes_on(reach, block):
        return list(_counted(reach, block))
    return _estimated(reach, block)


def restart(reach: Reach, block: SampleBlock) -> Gap | None:
    """Return the gap between the last received sample and the restart of the sample count.

    None if the times show no gap. Samples missing after the restart are not included. `reach` is
    the end of the received samples, `block` the first block of the new count.
    """
    stop_ns = _begin_ns(block) if n_missed(reach.stop_ns, block) else block.start_ns
    lost = _lost(reach, reach.stop_ns, stop_ns, block.rate_hz)
    return lost if lost.n_samples else None


def begins_anew(reach: Reach, block: SampleBlock) -> bool:
    """Whether the device restarted its sample count within the same epoch.

    It did if samples with the block's index were received before, but with earlier times.
    """
    if block.epoch != reach.epoch or block.first_index >= reach.stop_index:
        return False
    return block.start_ns - reach.stop_ns >= -_TOLERANCE.over(0) and not _goes_on(reach, block)


def n_missed(stop_ns: int, block: SampleBlock) -> int:
    """Return the number of samples missing between the start of a new count and its first block.

    The number is the block's index if the counter started at zero. If index and time place its
    start before `stop_ns`, the end of the samples received in earlier counts, the counter continued
    or wrapped, and the number is 0.
    """
    counted_ns = ns_from_s(block.first_index / block.rate_hz)
    return block.first_index if _begin_ns(block) - stop_ns >= -_TOLERANCE.over(counted_ns) else 0


def _goes_on(reach: Reach, block: SampleBlock) -> bool:
    """Whether the block continues the sample count of `reach`, by its index and its time."""
    if block.epoch != reach.epoch:
        return False
    passed_ns = ns_from_s((block.first_index - reach.stop_index) / block.rate_hz)
    deviation_ns = abs(block.start_ns - reach.stop_ns - passed_ns)
    poll_ns = ns_from_s(2.0 / block.rate_hz)  # up to a minute if each sample is a poll
    return deviation_ns <= poll_ns + _TOLERANCE.over(passed_ns)


def _counted(reach: Reach, block: SampleBlock) -> Iterator[Gap]:
    """Yield the unrecorded gaps between `reach` and a block of the same sample count."""
    at = reach.stop_index
    for gap in sorted(reach.gaps, key=lambda gap: gap.first_index):
        is_of_earlier_count = gap.stop_ns - reach.stop_ns < -_TOLERANCE.over(0)
        if gap.epoch != reach.epoch or is_of_earlier_count:
            continue
        if at < gap.first_index < block.first_index:
            yield _piece(block, at, gap.first_index)
        at = max(at, gap.first_index + gap.n_samples)
    if at < block.first_index:
        yield _piece(block, at, block.first_index)


def _piece(block: SampleBlock, start: int, stop: int) -> Gap:
    def time_ns(index: int) -> int:
        return block.start_ns - ns_from_s((block.first_index - index) / block.rate_hz)

    return Gap(block.epoch, start, stop - start, time_ns(stop), time_ns(start))


def _estimated(reach: Reach, block: SampleBlock) -> list[Gap]:
    """Return the gap between two sample counts and, if any, the gap at the start of the new one."""
    start_ns = max([reach.stop_ns, *(gap.stop_ns for gap in reach.gaps if gap.is_estimated)])
    begin_ns = _begin_ns(block)
    if block.epoch == reach.epoch or begin_ns < start_ns or block.first_index == 0:
        return [_lost(reach, start_ns, block.start_ns, block.rate_hz)]
    lost = _lost(reach, start_ns, begin_ns, block.rate_hz)
    return [lost, _piece(block, 0, block.first_index)]


def _begin_ns(block: SampleBlock) -> int:
    """Return the time of index 0 of the block's sample count, UTC nanoseconds since 1970."""
    return block.start_ns - ns_from_s(block.first_index / block.rate_hz)


def _lost(reach: Reach, start_ns: int, stop_ns: int, rate_hz: float) -> Gap:
    n_samples = max(0, round((stop_ns - start_ns) / NS_PER_S * rate_hz))
    start_ns = min(start_ns, stop_ns)  # a clock may have been set back
    return Gap(reach.epoch, reach.stop_index, n_samples, stop_ns, start_ns, is_estimated=True)


@dataclass(frozen=True)
class Count:
    """Current sample count of a unit.

    Parameters
    ----------
    reported
        Epoch that the adapter reports in its blocks.
    epoch
        Epoch assigned by `Counts`, used in the store and in the analysis.
    stop_index, stop_ns
        Index and time (UTC nanoseconds since 1970) of the first sample after the received ones.
    """

    reported: int
    epoch: int
    stop_index: int
    stop_ns: int


class Counts:
    """Assignment of epochs: a sample count that restarts within an epoch gets a new epoch.

    A device or a program that reads it may restart the count without reporting it. The index alone
    then looks like repeated samples; the time shows that they are new.

    `count` is the current sample count; None before the first block. Set it after a restart.
    """

    def __init__(self) -> None:
        self.count: Count | None = None

    def replayed(self, block: SampleBlock) -> SampleBlock:
        """Return a replayed block with the epoch that was assigned to its sample count."""
        if self.count is None or block.epoch != self.count.reported:
            return block
        return _in(block, self.count.epoch)

    def placed(self, block: SampleBlock) -> SampleBlock:
        """Return the next block with the epoch of its sample count, and update `count`.

        A restarted sample count gets a new epoch.
        """
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
