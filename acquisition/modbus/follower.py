"""Following a ring: which slots are new, which are lost, which are nonsense."""

from collections import Counter
from collections.abc import Sequence

from acquisition.errors import ConfigError
from acquisition.modbus.assembly import PlacedSlot, raw_blocks
from acquisition.modbus.profile import U32, RingHeader, RingLayout, Slot
from acquisition.modbus.ring_reader import RingReader
from acquisition.modbus.timeline import Refusal, Timeline, ahead
from acquisition.raw import RawBlock
from core.blocks import Rejection

_N_REREADS = 3
"""A device needs milliseconds to write a slot; still torn after this many round trips, it lies."""


class RingFollower:
    """Where a reader stands in one device's ring, kept across connections.

    On the first connection it starts with the newest slot. Later it continues after the last slot
    it has handled, as far back as the ring holds; the oldest slot is left alone, because the
    device may be overwriting it.

    Parameters
    ----------
    n_channels, rate_hz, n_slow
        What the device must offer.
    """

    def __init__(self, n_channels: int, rate_hz: float, n_slow: int) -> None:
        self._expected = {
            "n_channels": n_channels,
            "rate in mHz": round(rate_hz * 1000.0),
            "n_slow": n_slow,
        }
        self._n_slow = n_slow
        self._header: RingHeader | None = None
        self._timeline: Timeline
        self._handled = 0
        self._rejected: Counter[Refusal] = Counter()

    @property
    def newest(self) -> tuple[int, int] | None:
        """Epoch and newest sequence the device has shown."""
        return None if self._header is None else (self._header.epoch, self._header.newest)

    def require_expected(self, layout: RingLayout) -> None:
        """Refuse a device that cannot deliver what is configured.

        Raises
        ------
        ConfigError
            Naming the field, what was found and what was expected.
        """
        found = (layout.n_channels, layout.rate_mhz, layout.n_slow)
        for (name, expected), value in zip(self._expected.items(), found, strict=True):
            if value != expected:
                raise ConfigError(f"block ring: {name} is {value}, expected {expected}")

    async def advance(self, reader: RingReader) -> list[RawBlock]:
        """Read everything that is new, in order.

        Raises
        ------
        LinkError, FrameError, ConfigError
            As the reader does; nothing is forgotten then.
        """
        header, slow = await reader.header_and_slow(self._n_slow)
        self.require_expected(header.layout)
        await self._enter(reader, header)
        wanted = self._unread(header)
        slots = await self._read(reader, header.layout, wanted)
        if not wanted:
            return []
        epoch, newest = await reader.progress()
        if epoch != header.epoch:
            return []
        self._handled = header.newest
        oldest = newest - (header.layout.n_slots - 2)
        kept = [(s, slot) for s, slot in zip(wanted, slots, strict=True) if ahead(s, oldest) >= 0]
        return raw_blocks(self._place(kept, header), header.layout, slow)

    async def _enter(self, reader: RingReader, header: RingHeader) -> None:
        """Find the place to read from, when this is not simply the one after the last."""
        before = self._header
        if before is None:
            self._timeline = Timeline(header.layout)
            self._handled = header.newest - 1
        elif (before.epoch, before.layout) != (header.epoch, header.layout):
            slot = await self._newest_slot(reader, header)
            self._timeline = Timeline(header.layout)
            self._handled = header.newest - 1
            if slot is not None:
                self._timeline.anchor(slot)
                self._go_back_to_start(slot, header)
        elif ahead(header.newest, self._handled) < 0:
            slot = await self._newest_slot(reader, header)
            if slot is not None and not self._timeline.repeats(slot):
                self._timeline.restart(slot)
                self._go_back_to_start(slot, header)
        self._header = header

    def _go_back_to_start(self, newest: Slot, header: RingHeader) -> None:
        """Stand before the first slot of a new epoch, if the ring still holds it."""
        n_before = newest.first_index // header.layout.samples_per_slot
        self._handled = header.newest - 1 - min(n_before, header.layout.n_slots - 2)

    def _unread(self, header: RingHeader) -> list[int]:
        n_behind = ahead(header.newest, self._handled)
        n_wanted = min(n_behind, header.layout.n_slots - 1)
        return [(header.newest - back) % U32 for back in range(n_wanted - 1, -1, -1)]

    async def _newest_slot(self, reader: RingReader, header: RingHeader) -> Slot | None:
        [slot] = await self._read(reader, header.layout, [header.newest])
        usable = slot.sequence == header.newest and not slot.torn and not slot.blank
        return slot if usable else None

    async def _read(
        self, reader: RingReader, layout: RingLayout, wanted: Sequence[int]
    ) -> list[Slot]:
        """Read slots, torn ones again: the device may be writing them just now."""
        slots = await reader.slots(layout, wanted)
        for i, sequence in enumerate(wanted):
            for _ in range(_N_REREADS):
                if not slots[i].torn:
                    break
                [slots[i]] = await reader.slots(layout, [sequence])
        return slots

    def _place(self, found: Sequence[tuple[int, Slot]], header: RingHeader) -> list[PlacedSlot]:
        placed = []
        for sequence, slot in found:
            index = self._judge(sequence, slot, header.layout.n_slots)
            if isinstance(index, Refusal):
                self._rejected[index] += header.layout.samples_per_slot
            elif index is not None:
                epoch = header.epoch + self._timeline.n_resets * U32
                placed.append(PlacedSlot(slot, epoch, index, self._taken_rejections()))
        return placed

    def _judge(self, sequence: int, slot: Slot, n_slots: int) -> int | Refusal | None:
        """Index of the slot's first sample; None if it was never written or is gone."""
        if slot.blank:
            return None
        if slot.sequence != sequence:
            same_place = slot.sequence % n_slots == sequence % n_slots
            return None if same_place else Refusal.WRONG_SEQUENCE
        if slot.torn:
            return Refusal.TORN
        return self._timeline.place(slot)

    def _taken_rejections(self) -> tuple[Rejection, ...]:
        rejections = tuple(Rejection(str(r), n) for r, n in self._rejected.items())
        self._rejected.clear()
        return rejections
