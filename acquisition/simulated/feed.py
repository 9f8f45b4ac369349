"""Samples without a wire: feeds, a feed cut into slots, and the ledger of offered samples."""

from collections import Counter
from typing import Protocol

from acquisition.delivery.blocks import BlockGrid
from acquisition.delivery.raw import RawBlock


class FeedEndedError(Exception):
    """A sample feed has ended, as at the end of a recording."""


class SampleFeed(Protocol):
    """Source of samples of a simulated device, as its converter delivers them."""

    def advance(self, n_samples: int) -> RawBlock:
        """Return the next samples.

        A simulated unit returns as many as requested, directly after the previous ones. A recording
        returns fewer before a gap or a restart of the device, and continues behind it.

        Raises
        ------
        FeedEndedError
            If the feed has ended.
        """
        ...


class Ledger:
    """Samples per channel offered by each unit in each epoch, including lost ones."""

    def __init__(self) -> None:
        self._offered: Counter[tuple[str, int]] = Counter()

    def offer(self, unit: str, epoch: int, n_samples: int) -> None:
        """Count samples that a device has produced."""
        self._offered[unit, epoch] += n_samples

    def n_samples(self, unit: str, epoch: int | None = None) -> int:
        """Number of samples offered by a unit, in one epoch or in all."""
        return sum(n for (u, e), n in self._offered.items() if u == unit and epoch in (None, e))


class SlotFeed:
    """Feed cut into slots, one slot ahead, so that a device knows the length of a gap.

    A slot begins at a multiple of its length. Samples that fill no slot before a gap, a restart or
    the end of the feed are left out.
    """

    def __init__(self, feed: SampleFeed, samples_per_slot: int) -> None:
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
        """Number of a slot on the grid."""
        return slot.first_index // self._samples_per_slot

    def _next(self) -> RawBlock:
        """Return the next whole slot; a piece of the feed completes at most one."""
        while True:
            for block in self._grid.put(self._feed.advance(self._samples_per_slot)):
                if block.n_samples == self._samples_per_slot:
                    return block
