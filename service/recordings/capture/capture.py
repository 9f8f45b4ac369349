"""`Capture`: one that is being made."""

from collections import deque
from dataclasses import dataclass, field

from core.alarms.alarm import AlarmEvent
from core.samples.blocks import SampleBlock
from service.recordings.capture.file import CaptureFile
from service.recordings.capture.span import Span


@dataclass
class Capture:
    """One capture that is being made.

    Parameters
    ----------
    alarms
        The events it is made for; the first has begun it.
    deadline_s
        When it is finished with what there is, on the steady clock.
    pending
        Blocks that are still to be written; filled on the event loop, emptied in the thread.
    is_lost
        Whether the disk was too slow for it.
    is_replaced
        Whether another one holds all of it, and more.
    """

    file: CaptureFile
    span: Span
    alarms: list[AlarmEvent]
    deadline_s: float
    pending: deque[SampleBlock] = field(default_factory=deque)
    is_lost: bool = False
    is_replaced: bool = False

    def add(self, block: SampleBlock) -> None:
        """Take a block, if it belongs here."""
        if self.span.goes_on_to(block) and not self.is_lost:
            self.pending.append(block)
            self.span = self.span.with_block(block)

    @property
    def n_pending_samples(self) -> int:
        """Samples of all channels that are still to be written."""
        return len(self.pending) * self.pending[0].samples.size if self.pending else 0
