"""What goes on a tape: blocks, and how much was left out before the next one."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import StrEnum

from core.samples.blocks import Rejection, SampleBlock


class Shed(StrEnum):
    """Why samples are not in a continuous recording; what the recording itself says."""

    ANALYSIS_BEHIND = "analysis_behind"
    DISK_SLOW = "disk_slow"
    DISK_FULL = "disk_full"
    DISK_REFUSED = "disk_refused"
    NOT_RUNNING = "not_running"
    GAP_BEFORE = "gap_before"
    """A gap of the device itself, where one recording ends and the next begins."""


@dataclass(frozen=True)
class TapeSettings:
    """How a continuous recording is cut.

    Parameters
    ----------
    stretch_s
        Length of a finished recording.
    part_s
        What is written and synced at once: a kill costs no more than this, and what waits.
    """

    stretch_s: float = 600.0
    part_s: float = 30.0


@dataclass
class Hole:
    """Samples that were offered and are left out, all of one epoch.

    Parameters
    ----------
    n_samples
        By reason, per channel.
    """

    epoch: int = 0
    n_samples: Counter[str] = field(default_factory=Counter)

    def add(self, epoch: int, rejected: Iterable[Rejection]) -> None:
        """Leave out more; what was of an earlier epoch has no place in a later one."""
        if epoch != self.epoch:
            self.epoch, self.n_samples = epoch, Counter()
        for each in rejected:
            self.n_samples[each.reason] += each.n_samples

    def skip(self, block: SampleBlock, reason: str) -> None:
        """Leave out a block, with what was refused before it."""
        self.add(block.epoch, (*block.rejected, Rejection(reason, block.n_samples)))

    def before(self, block: SampleBlock) -> SampleBlock:
        """The block that says what is missing before it."""
        if not self.n_samples or self.epoch != block.epoch:
            return block
        total = self.n_samples.copy()
        for each in block.rejected:
            total[each.reason] += each.n_samples
        return replace(block, rejected=tuple(Rejection(r, n) for r, n in total.items()))

    def clear(self) -> None:
        """Begin anew: it has been said."""
        self.n_samples = Counter()
