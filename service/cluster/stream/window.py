"""Which messages of a stream hold the samples that must be seen once more after a move."""

from collections import deque
from dataclasses import dataclass

from core.monitor.monitor import MonitorState
from core.samples.blocks import SampleBlock


@dataclass(frozen=True)
class _Seen:
    sequence: int
    epoch: int | None
    stop_index: int


class Window:
    """The newest messages of a unit, by what they hold."""

    def __init__(self) -> None:
        self._seen: deque[_Seen] = deque()

    def note(self, sequence: int, block: SampleBlock, state: MonitorState) -> None:
        """Take note of a block that was taken in, and let go of what is needed no more.

        Parameters
        ----------
        state
            Behind the block; its epoch is that of the block for the analysis.
        """
        self._seen.append(_Seen(sequence, state.epoch, block.stop_index))
        while len(self._seen) > 1 and not self._is_needed(self._seen[0], state):
            self._seen.popleft()

    def first(self, otherwise: int) -> int:
        """The first message that is needed."""
        return self._seen[0].sequence if self._seen else otherwise

    @staticmethod
    def _is_needed(seen: _Seen, state: MonitorState) -> bool:
        return seen.epoch == state.epoch and seen.stop_index > state.start
