"""Samples without a wire: a feed cut into slots, and the ledger of what a device has offered."""

from collections import Counter
from typing import Protocol

from acquisition.delivery.blocks import BlockGrid
from acquisition.delivery.raw import RawBlock


class FeedEndedError(Exception):
    """A feed has no more samples, as at the end of a recording."""


class RawFeed(Protocol):
    """The converter of a simulated device."""

    def advance(self, n_samples: int) -> RawBlock:
        """Produce the next samples.

        A simulated unit gives as many, following directly on the previous ones. A recording gives
        fewer before a gap or a restart of the device, and continues after it.

        Raises
        ------
        FeedEndedError
            If there are no more.
        """
        ...


class Ledger:
    """Samples per channel offered by each unit in each epoch, lost ones included."""

    def __init__(self) -> None:
        self._offered: Counter[tuple[str, int]] = Counter()

    def offer(self, unit: str, epoch: int, n_samples: int) -> None:
        """Book samples that a device has produced."""
        self._offered[unit, epoch] += n_samples

    def n_samples(self, unit: str, epoch: int | None = None) -> int:
        """Samples offered by a unit, in one epoch or in all."""
        return sum(n for (u, e), n in self._offered.items() if u == unit and epoch in (None, e))


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
