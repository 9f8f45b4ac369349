"""`Counts`: notices a device that counts the same epoch anew, and gives that count another number.

A device may begin its count again without telling, and so may a program that reads it. By the
index alone, all that it then delivers has been there; its time says that it is new.
"""

from dataclasses import dataclass, replace

from core.samples.axis import RECOUNTED_EPOCHS
from core.samples.blocks import SampleBlock
from core.samples.outage import Reach, begins_anew
from core.units import NS_PER_S

_SECONDS = 1 << 32


@dataclass(frozen=True)
class Count:
    """The count that a unit is in.

    Parameters
    ----------
    told
        Its epoch as blocks name it.
    epoch
        As everything behind this names it.
    stop_index, stop_ns
        Of the first sample after those that have arrived.
    """

    told: int
    epoch: int
    stop_index: int
    stop_ns: int


class Counts:
    """Stands where the blocks of one unit come in, so that epoch and index say which sample it is.

    Attributes
    ----------
    count
        None before the first block.
    """

    def __init__(self) -> None:
        self.count: Count | None = None

    def go_on(self, count: Count | None) -> None:
        """Be in a count that was begun elsewhere."""
        self.count = count

    def again(self, block: SampleBlock) -> SampleBlock:
        """A block that was taken in before, in the count that it was taken in with."""
        if self.count is None or block.epoch != self.count.told:
            return block
        return _in(block, self.count.epoch)

    def placed(self, block: SampleBlock) -> SampleBlock:
        """The next block, in the count that it belongs to."""
        count = self.count
        epoch, is_new = block.epoch, True
        if count is not None and block.epoch == count.told:
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
