"""`FifoDevice`: a simulated device whose samples wait in queues, for function 0x18."""

from collections import deque
from collections.abc import Mapping
from itertools import islice, pairwise
from typing import TypeAlias

import numpy as np

from acquisition.errors import ConfigError
from acquisition.modbus.fifo_layout import FifoKind, FifoLayout
from acquisition.simulated.devices.map_device import MapDevice
from acquisition.simulated.feed import Ledger, RawFeed, SlotFeed
from core.arrays import CountArray

_Record: TypeAlias = tuple[int, CountArray]
"""Counter and samples of one moment."""

_COUNTER_MODULUS = 65536
_LAST_LOOKS = 2
_ON_DEMAND_STEPS = 16


class FifoDevice:
    """One unit's converter with queues of counts; what does not fit is lost, oldest first.

    Parameters
    ----------
    depth_samples
        Samples per channel that the queues hold.
    step_samples
        Samples that come at once.
    first_counter
        Counter of the first sample of all; near 65535 it wraps soon.
    registers
        A device whose registers are read at the same address; its samples pass on their own.

    Attributes
    ----------
    frozen
        While set, nothing new is produced.
    on_demand
        Whether the device produces when its reader has emptied the queues.
    n_lost
        Samples that did not fit.

    Raises
    ------
    ConfigError
        If the feed has nothing, or has no counts.
    """

    def __init__(
        self,
        feed: RawFeed,
        layout: FifoLayout,
        unit: str = "U1",
        *,
        depth_samples: int = 4096,
        step_samples: int = 2,
        first_counter: int = 0,
        registers: MapDevice | None = None,
        ledger: Ledger | None = None,
    ) -> None:
        self._feed = SlotFeed(feed, step_samples)
        self._layout, self._unit, self._step_samples = layout, unit, step_samples
        self._registers = registers
        self.ledger = ledger or Ledger()
        self.identification: Mapping[int, bytes] = {}
        self.frozen = self.on_demand = self.ended = False
        self.n_lost = 0
        n_queues = len(layout.addresses)
        self._queues: list[deque[_Record]] = [deque(maxlen=depth_samples) for _ in range(n_queues)]
        self._n_frozen = self._n_dropped = self._n_looks = self._n_restarts = 0
        first = self._feed.peek()
        if first is None or first.counts.dtype != np.int16:
            raise ConfigError("a queue takes counts of a converter; the feed has none")
        self._rate_hz, self._epoch = first.rate_hz, first.epoch
        self._position = self._feed.number(first) - 1
        self._offset = first_counter - first.first_index
        self.produce()

    @property
    def step_s(self) -> float:
        """Time that one step covers."""
        return self._step_samples / self._rate_hz

    @property
    def drained(self) -> bool:
        """Whether the feed has ended and a reader has emptied the queues and looked again."""
        return self.ended and self._n_looks >= _LAST_LOOKS

    def produce(self, n_steps: int = 1) -> None:
        """Let so much time pass."""
        for _ in range(n_steps):
            if self.frozen or self._n_frozen:
                self._n_frozen = max(self._n_frozen - 1, 0)
                continue
            ahead = self._feed.peek()
            if ahead is None:
                self.ended = True
                return
            self._position += 1
            if ahead.epoch != self._epoch:
                self._epoch, self._offset = ahead.epoch, -ahead.first_index
                self._position = self._feed.number(ahead)
            if self._feed.number(ahead) <= self._position:
                self._position = self._feed.number(ahead)
                self._take()
            if self._registers is not None:
                self._registers.produce()

    def restart(self) -> None:
        """Power off and on: queues empty, counter at zero."""
        self._n_restarts += 1
        for queue in self._queues:
            queue.clear()
        ahead = self._feed.peek()
        if ahead is not None:
            self._offset = -ahead.first_index

    def read_fifo(self, address: int) -> bytes | None:
        """Answer function 0x18; None if there is no such queue."""
        if address not in self._layout.addresses:
            return None
        queue = self._queues[self._layout.addresses.index(address)]
        all_were_read = not any(self._queues) or not self._layout.removes
        data = self._encode(self._reading(queue))
        if all_were_read:  # and so the answer is empty, or as before: now time may pass
            self._look()
        return data

    def read_registers(self, function: int, address: int, count: int) -> bytes | None:
        """Answer functions 3 and 4 of the registers beside the queues."""
        registers = self._registers
        return registers.read_registers(function, address, count) if registers else None

    def read_bits(self, function: int, address: int, count: int) -> bytes | None:
        """Answer functions 1 and 2 of the registers beside the queues."""
        return self._registers.read_bits(function, address, count) if self._registers else None

    def fault_names(self) -> list[str]:
        """What can happen: lost samples, an overflow of the queues, a standstill, a restart."""
        return ["drop", "overflow", "freeze", "reset_counter"]

    def spoil(self, fault: str, count: int) -> None:
        """Let one of these happen to the next steps, or at once."""
        match fault:
            case "drop":
                self._n_dropped += count
            case "freeze":
                self._n_frozen += count
            case "overflow":
                for queue in self._queues:
                    for _ in range(min(count, len(queue))):
                        queue.popleft()
                        self.n_lost += 1
            case "reset_counter":
                self.restart()

    def _take(self) -> None:
        raw = self._feed.take()
        if raw is None:
            return
        self.ledger.offer(self._unit, raw.epoch, raw.n_samples)
        self._n_looks = 0
        if self._n_dropped:
            self._n_dropped -= 1
            return
        first = raw.first_index + self._offset
        for n in range(raw.n_samples):
            self._put((first + n) % _COUNTER_MODULUS, raw.counts[:, n].astype(np.int16))

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
        """Note that a reader has found nothing new."""
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
    """Where a queue of one channel must be cut, since only its first sample has a counter."""
    if kind is FifoKind.INTERLEAVED:
        return []
    pairs = enumerate(pairwise(records), start=1)
    return [n for n, ((a, _), (b, _)) in pairs if b != (a + 1) % _COUNTER_MODULUS]


def _first_run(records: list[_Record], kind: FifoKind) -> list[_Record]:
    return records[: next(iter(_jumps(records, kind)), len(records))]


def _last_run(records: list[_Record], kind: FifoKind) -> list[_Record]:
    return records[max(_jumps(records, kind), default=0) :]
