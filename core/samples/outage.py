"""The hole that is left when nobody looked: between the last sample kept and the first new one.

Where the device has gone on counting, the hole is counted by its index and exact. Where it counts
anew, only times are left, and the number of samples is worked out from them and said to be so.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from core.samples.account import Gap
from core.samples.axis import ClockTolerance
from core.samples.blocks import SampleBlock
from core.units import NS_PER_S, ns_from_s

_TOLERANCE = ClockTolerance()


@dataclass(frozen=True)
class Reach:
    """How far the samples of a unit reach that are accounted for.

    Parameters
    ----------
    epoch, stop_index
        Of the first sample after them, on the axis that the device counted on then.
    stop_ns
        Its time.
    gaps
        Recorded behind it already, oldest first.
    """

    epoch: int
    stop_index: int
    stop_ns: int
    gaps: Sequence[Gap] = ()


def outage(reach: Reach, block: SampleBlock) -> list[Gap]:
    """Say what is missing between what is accounted for and the first block after it.

    Returns
    -------
    One gap for every stretch that is not recorded yet; none if the block follows, or goes over what
    is there once more.
    """
    if _goes_on(reach, block):
        return list(_counted(reach, block))
    return _estimated(reach, block)


def restart(reach: Reach, block: SampleBlock) -> Gap | None:
    """Say what is missing between the last sample that arrived and the restart of its device.

    Returns
    -------
    None if by the device's clock nothing is; what it has counted since is no part of it.
    """
    stop_ns = _begin_ns(block) if n_missed(reach.stop_ns, block) else block.start_ns
    lost = _lost(reach, reach.stop_ns, stop_ns, block.rate_hz)
    return lost if lost.n_samples else None


def begins_anew(reach: Reach, block: SampleBlock) -> bool:
    """Whether a block that lies behind what has arrived, by its index, is new by its time.

    Then it is no repetition: the device has begun to count again, in the same epoch.
    """
    if block.epoch != reach.epoch or block.first_index >= reach.stop_index:
        return False
    return block.start_ns - reach.stop_ns >= -_TOLERANCE.over(0) and not _goes_on(reach, block)


def n_missed(stop_ns: int, block: SampleBlock) -> int:
    """Samples of a new count that were not delivered, before the first block of it.

    A count that by its index began before the last sample that arrived says nothing of what is
    missing: it is of one that was not begun but found, as a counter that went on or has wrapped.

    Parameters
    ----------
    stop_ns
        Time up to which samples have arrived, of counts before.
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
