"""From readings of queues to samples of all channels with their places."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from acquisition.errors import FrameError
from acquisition.modbus.counted_samples import WRAP, CountedSamples, Place
from acquisition.modbus.fifo_layout import FifoPiece
from acquisition.modbus.uncounted_samples import UncountedSamples
from core.arrays import CountArray

_MOST_EPOCHS = 2

_MOST_APART = 1024
"""Samples by which the queues of two channels may differ, since they are read one by one."""


@dataclass(frozen=True)
class PlacedSamples:
    """Consecutive samples of all channels: (n_channels, n_samples) counts."""

    epoch: int
    first_index: int
    counts: CountArray

    @property
    def stop_index(self) -> int:
        """Index of the first sample after them."""
        return self.first_index + int(self.counts.shape[1])


def place_records(
    piece: FifoPiece, samples: CountedSamples | UncountedSamples, now_s: float
) -> list[PlacedSamples]:
    """Place the records of an interleaved queue; those that came before are left out.

    Raises
    ------
    FrameError
        If what should be a counter counts nothing: no device restarts twice within a reading.
    """
    places = list(_places(piece, samples, now_s))
    if len({place.epoch for place in places if place is not None}) > _MOST_EPOCHS:
        raise FrameError("FIFO: what should be its counter does not count")
    return list(_joined(places, piece.counts))


def _places(
    piece: FifoPiece, samples: CountedSamples | UncountedSamples, now_s: float
) -> Iterator[Place | None]:
    if isinstance(samples, UncountedSamples):
        yield from (samples.place() for _ in range(piece.n_samples))
    elif piece.counters is not None:
        yield from (samples.place(int(counter), now_s) for counter in piece.counters)


def _joined(places: Iterable[Place | None], counts: CountArray) -> Iterator[PlacedSamples]:
    start, first = 0, None
    for n, place in enumerate([*places, None]):
        if first is not None and place == Place(first.epoch, first.index + n - start):
            continue
        if first is not None:
            yield PlacedSamples(first.epoch, first.index, counts[:, start:n])
        start, first = n, place


class ChannelAssembly:
    """Puts the queues of single channels side by side, by the counter of the first of them.

    Samples wait until all channels have them; what one channel has lost is a gap of all.
    """

    def __init__(self, n_channels: int, samples: CountedSamples) -> None:
        self._samples = samples
        self._epoch = -1
        self._next = self._newest = 0
        self._waiting: list[dict[int, int]] = [{} for _ in range(n_channels)]

    def forget(self) -> None:
        """Drop what waits, as on a new connection."""
        for waiting in self._waiting:
            waiting.clear()

    def place(self, pieces: list[FifoPiece], now_s: float) -> list[PlacedSamples]:
        """Place one reading of each queue, in the order of the channels.

        Raises
        ------
        FrameError
            If the channels count differently, as when the device restarts between two of them.
        """
        first, *others = pieces
        for sample in place_records(first, self._samples, now_s):
            if sample.epoch != self._epoch:
                self.forget()
                self._epoch, self._next = sample.epoch, sample.first_index
            self._add(0, range(sample.first_index, sample.stop_index), sample.counts[0])
            self._newest = sample.stop_index
        for channel, piece in enumerate(others, start=1):
            self._add_other(channel, piece)
        return self._common()

    def _add_other(self, channel: int, piece: FifoPiece) -> None:
        if piece.counters is None or not piece.n_samples or self._epoch < 0:
            return
        apart = (int(piece.counters[0]) - self._newest + WRAP // 2) % WRAP - WRAP // 2
        if abs(apart) > _MOST_APART:
            raise FrameError(f"FIFO: channel {channel} counts {apart} samples apart from channel 0")
        start = self._newest + apart
        self._add(channel, range(start, start + piece.n_samples), piece.counts[0])

    def _add(self, channel: int, index: range, counts: CountArray) -> None:
        fresh = zip(index, counts.tolist(), strict=True)
        self._waiting[channel].update((i, count) for i, count in fresh if i >= self._next)

    def _common(self) -> list[PlacedSamples]:
        """What all channels have, and nothing older than that ever again."""
        shared = set.intersection(*(set(waiting) for waiting in self._waiting))
        if not shared:
            self._limit()
            return []
        index = np.array(sorted(shared))
        counts = np.array(
            [[waiting[i] for i in index.tolist()] for waiting in self._waiting], dtype=np.int16
        )
        self._next = int(index[-1]) + 1
        self._drop_old()
        places = (Place(self._epoch, i) for i in index.tolist())
        return list(_joined(places, counts))

    def _limit(self) -> None:
        """Bound what waits for a channel that gives nothing."""
        newest = max((max(waiting) for waiting in self._waiting if waiting), default=0)
        self._next = max(self._next, newest - _MOST_APART)
        self._drop_old()

    def _drop_old(self) -> None:
        for waiting in self._waiting:
            for index in [i for i in waiting if i < self._next]:
                del waiting[index]
