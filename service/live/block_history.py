"""The newest blocks of a unit, so that an alarm can be seen coming."""

from collections import deque
from collections.abc import Iterator

from core.samples.blocks import SampleBlock


class BlockHistory:
    """Holds the blocks of the last so many samples; what is repeated is not held twice.

    Parameters
    ----------
    n_samples
        Per channel; one block more than that is held at most.
    """

    def __init__(self, n_samples: int) -> None:
        self._n_wanted = n_samples
        self._n_held = 0
        self._blocks: deque[SampleBlock] = deque()

    def __iter__(self) -> Iterator[SampleBlock]:
        """Oldest first."""
        return iter(self._blocks)

    def add(self, block: SampleBlock) -> bool:
        """Take a block in, and let go of what is too old; return whether there is anything new."""
        if self._blocks and _is_repeated(block, self._blocks[-1]):
            return False
        self._blocks.append(block)
        self._n_held += block.n_samples
        while self._n_held - self._blocks[0].n_samples >= self._n_wanted + block.n_samples:
            self._n_held -= self._blocks.popleft().n_samples
        return True


def _is_repeated(block: SampleBlock, newest: SampleBlock) -> bool:
    return block.epoch == newest.epoch and block.stop_index <= newest.stop_index
