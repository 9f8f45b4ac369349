"""Simulated Modbus device with sample queues, read with function 0x18 (Read FIFO Queue)."""

from collections import deque
from collections.abc import Callable, Mapping
from itertools import islice, pairwise
from typing import TypeAlias

import numpy as np

from acquisition.errors import ConfigError
from acquisition.modbus.fifo_assembly import FifoKind, FifoLayout
from acquisition.simulated.devices.modbus_device import ModbusDevice
from acquisition.simulated.feed import Ledger, SampleFeed
from core.arrays import CountArray
from core.samples.blocks import SampleBlock

_Record: TypeAlias = tuple[int, CountArray]
"""Sample in a queue: counter and counts, (n_channels,) if interleaved, otherwise (1,)."""

_COUNTER_MODULUS = 65536
_ON_DEMAND_STEPS = 16


class FifoDevice(ModbusDevice):
    """Simulated Modbus device of one unit with sample queues; a full queue drops its oldest sample.

    `ledger` counts the produced samples, by default in a new `Ledger`, for the unit named `unit`.

    Parameters
    ----------
    layout
        Register addresses and format of the queues.
    depth_samples
        Maximum number of samples in a queue.
    step_samples
        Number of samples per channel that are produced together.
    first_counter
        Counter of the first sample; the counter wraps after 65535.

    Attributes
    ----------
    n_lost
        Number of lost samples of all queues.

    Raises
    ------
    ConfigError
        If the feed is empty, or its samples are not int16 counts.
    """

    def __init__(
        self,
        feed: SampleFeed,
        layout: FifoLayout,
        unit: str = "U1",
        *,
        depth_samples: int = 4096,
        step_samples: int = 2,
        first_counter: int = 0,
        ledger: Ledger | None = None,
    ) -> None:
        super().__init__(feed, step_samples, unit, ledger)
        self._layout, self._step_samples = layout, step_samples
        self.n_lost = 0
        n_queues = len(layout.addresses)
        self._queues: list[deque[_Record]] = [deque(maxlen=depth_samples) for _ in range(n_queues)]
        self._n_dropped = 0
        first = self._feed.peek()
        if first is None or first.counts.dtype != np.int16:
            found = "no samples" if first is None else f"{first.counts.dtype} samples"
            raise ConfigError(f"simulated FIFO queue: samples must be 16-bit counts, got {found}")
        self._rate_hz, self._feed_epoch = first.rate_hz, first.epoch
        self._position = self._feed.number(first) - 1
        self._offset = first_counter - first.first_index
        self.produce()

    @property
    def step_s(self) -> float:
        """Duration of `step_samples` samples in seconds."""
        return self._step_samples / self._rate_hz

    @property
    def faults(self) -> Mapping[str, Callable[[int], None]]:
        """Fault injectors by name, called with a count: lost steps, overflow, freeze, restart."""
        return {
            **super().faults,
            "drop": self._drop,
            "overflow": self._overflow,
            "reset_counter": lambda _: self.restart(),
        }

    def restart(self) -> None:
        """Restart the device: clear the queues and set the counter to zero."""
        for queue in self._queues:
            queue.clear()
        ahead = self._feed.peek()
        if ahead is not None:
            self._offset = -ahead.first_index

    def read_fifo(self, address: int) -> bytes | None:
        """Return the queue at an address as big-endian words; None if there is no such queue."""
        if address not in self._layout.addresses:
            return None
        queue = self._queues[self._layout.addresses.index(address)]
        all_were_read = not any(self._queues) or not self._layout.removes
        data = self._encode(self._reading(queue))
        if all_were_read:  # a reply without new samples lets time pass
            self._look()
        return data

    def _show(self, raw: SampleBlock) -> None:
        if raw.epoch != self._feed_epoch:
            self._offset = -raw.first_index
        self.ledger.offer(self._unit, raw.epoch, raw.n_samples)
        self._n_looks = 0
        if self._n_dropped:
            self._n_dropped -= 1
            return
        first = raw.first_index + self._offset
        for n in range(raw.n_samples):
            self._put((first + n) % _COUNTER_MODULUS, raw.counts[:, n].astype(np.int16))

    def _drop(self, count: int) -> None:
        self._n_dropped += count

    def _overflow(self, count: int) -> None:
        for queue in self._queues:
            for _ in range(min(count, len(queue))):
                queue.popleft()
                self.n_lost += 1

    def _put(self, counter: int, sample: CountArray) -> None:
        for n, queue in enumerate(self._queues):
            self.n_lost += len(queue) == queue.maxlen
            own = sample if self._layout.kind is FifoKind.INTERLEAVED else sample[n : n + 1]
            queue.append((counter, own))

    def _reading(self, queue: deque[_Record]) -> list[_Record]:
        most = self._layout.most_samples
        if not self._layout.removes:
            return _last_run(list(queue)[-most:], self._layout.kind)
        run = _first_run(list(islice(queue, most)), self._layout.kind)
        for _ in run:
            queue.popleft()
        return run

    def _look(self) -> None:
        """Count a read without new samples after the end of the feed; if on demand, add samples."""
        self._n_looks += self.ended
        if self.on_demand:
            self.produce(_ON_DEMAND_STEPS if self._layout.removes else 1)

    def _encode(self, records: list[_Record]) -> bytes:
        if self._layout.kind is FifoKind.INTERLEAVED:
            counted = self._layout.has_counter
            return b"".join(
                (counter.to_bytes(2, "big") if counted else b"") + sample.astype(">i2").tobytes()
                for counter, sample in records
            )
        head = records[0][0].to_bytes(2, "big") if records else b""
        return head + b"".join(sample.astype(">i2").tobytes() for _, sample in records)


def _jumps(records: list[_Record], kind: FifoKind) -> list[int]:
    """Return the indices after counter jumps, where a reply with one counter must end.

    Return an empty list for interleaved queues.
    """
    if kind is FifoKind.INTERLEAVED:
        return []
    pairs = enumerate(pairwise(records), start=1)
    return [n for n, ((a, _), (b, _)) in pairs if b != (a + 1) % _COUNTER_MODULUS]


def _first_run(records: list[_Record], kind: FifoKind) -> list[_Record]:
    return records[: next(iter(_jumps(records, kind)), len(records))]


def _last_run(records: list[_Record], kind: FifoKind) -> list[_Record]:
    return records[max(_jumps(records, kind), default=0) :]
