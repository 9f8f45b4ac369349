"""`SlotFeed`: a raw feed in whole slots that lie on one grid of sample numbers."""

from acquisition.block_grid import BlockGrid
from acquisition.raw import FeedEndedError, RawBlock, RawFeed


class SlotFeed:
    """Looks one slot ahead, so that a device can tell how long a gap of its feed is.

    A slot begins at a multiple of its length. What a feed gives before a gap, a restart or its end
    and that fills no slot is left out.
    """

    def __init__(self, feed: RawFeed, samples_per_slot: int) -> None:
        self._feed = feed
        self._samples_per_slot = samples_per_slot
        self._grid = BlockGrid(samples_per_slot)
        self._ahead: RawBlock | None = None

    def peek(self) -> RawBlock | None:
        """Return the next slot and keep it; None if the feed has ended."""
        if self._ahead is None:
            try:
                self._ahead = self._next()
            except FeedEndedError:
                return None
        return self._ahead

    def take(self) -> RawBlock | None:
        """Return the next slot; None if the feed has ended."""
        slot = self.peek()
        self._ahead = None
        return slot

    def number(self, slot: RawBlock) -> int:
        """Place of a slot on the grid."""
        return slot.first_index // self._samples_per_slot

    def _next(self) -> RawBlock:
        """Return the next whole slot; a piece no longer than a slot completes one at most."""
        while True:
            for block in self._grid.put(self._feed.advance(self._samples_per_slot)):
                if block.n_samples == self._samples_per_slot:
                    return block
