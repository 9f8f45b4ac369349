"""Following a block ring: which slots are new, which are lost, which are nonsense."""

from collections import Counter
from collections.abc import Iterator, Sequence

from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError, FrameError
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.ring_profile import (
    HEADER_REGISTERS,
    U32,
    RingHeader,
    RingLayout,
    Slot,
    decode_header,
    decode_slot,
)
from acquisition.modbus.timeline import Refusal, Timeline, ahead
from core.samples.axis import Epochs
from core.samples.blocks import Rejection

_N_TRIES = 4
"""A header is short and quickly written; still wrong after this many reads, it is wrong."""


class RingReader:
    """One device's ring, as it is found: slots are not judged here."""

    def __init__(self, link: ModbusClient, base_address: int, function: int) -> None:
        self._link = link
        self._base = base_address
        self._function = function

    @property
    def where(self) -> str:
        """Host and port, or path of the serial port."""
        return self._link.where

    async def header(self) -> RingHeader:
        """Read and decode the header alone.

        Raises
        ------
        ConfigError
            If this is no block ring.
        FrameError
            If its checksum is wrong, however often it is read.
        LinkError
            As the link says.
        """
        n_tries = 0
        while True:
            data = await self._registers(self._base, HEADER_REGISTERS)
            n_tries += 1
            try:
                return decode_header(data)
            except (ConfigError, FrameError) as error:
                if n_tries == _N_TRIES:
                    raise type(error)(f"{self.where}: {error}") from error

    async def slots(self, layout: RingLayout, sequences: Sequence[int]) -> list[Slot]:
        """Read the places where these sequence numbers belong, whatever lies there.

        Returns
        -------
        list
            One slot for each sequence number asked.
        """
        found: list[Slot] = []
        for address, n_slots in _runs(layout, sequences):
            n_registers = (n_slots - 1) * layout.slot_stride + layout.slot_registers
            data = memoryview(await self._registers(address, n_registers))
            found += [
                decode_slot(data[2 * layout.slot_stride * i :], layout) for i in range(n_slots)
            ]
        return found

    async def _registers(self, address: int, n_registers: int) -> bytes:
        return await self._link.read(address, n_registers, self._function)


def _runs(layout: RingLayout, sequences: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Address and number of the slots that lie side by side and without padding."""
    start, n_slots = 0, 0
    for sequence in sequences:
        address = layout.slot_address(sequence)
        if n_slots and address == start + n_slots * layout.slot_stride and _dense(layout):
            n_slots += 1
            continue
        if n_slots:
            yield start, n_slots
        start, n_slots = address, 1
    if n_slots:
        yield start, n_slots


def _dense(layout: RingLayout) -> bool:
    return layout.slot_stride == layout.slot_registers


_N_REREADS = 3
"""A device needs milliseconds to write a slot; still torn after this many round trips, it lies."""

_AT_ONCE_S = 0.5
"""Samples that are read before they are handed on: what a ring holds after an outage takes a slow
line seconds, and would be asked for all over again if that fails before its end."""


class RingFollower:
    """Where a reader stands in one device's ring, kept across connections.

    On the first connection it starts with the newest slot. Later it continues after the last slot
    it has handled, as far back as the ring holds; the oldest slot is left alone, because the
    device may be overwriting it.

    Parameters
    ----------
    n_channels, rate_hz, n_slow
        What the device must offer.
    begun_ns
        When this life of the adapter began, UTC.
    """

    def __init__(self, n_channels: int, rate_hz: float, n_slow: int, begun_ns: int) -> None:
        self._expected = {
            "n_channels": n_channels,
            "rate in mHz": round(rate_hz * 1000.0),
            "n_slow": n_slow,
        }
        self._header: RingHeader | None = None
        self._timeline: Timeline
        self._epochs = Epochs(begun_ns, trusts_device=True)
        self._handled = 0
        self._rejected: Counter[Refusal] = Counter()

    @property
    def newest(self) -> tuple[int, int] | None:
        """Epoch and newest sequence the device has shown."""
        return None if self._header is None else (self._header.epoch, self._header.newest)

    async def header(self, reader: RingReader) -> RingHeader:
        """Read the header of a device that delivers what is configured.

        Raises
        ------
        ConfigError
            If it does not, naming the field, what was found and what was expected.
        LinkError, FrameError
            As the reader does.
        """
        header = await reader.header()
        ring = header.layout
        found = (ring.n_channels, ring.rate_mhz, ring.n_slow)
        for (name, expected), value in zip(self._expected.items(), found, strict=True):
            if value != expected:
                raise ConfigError(
                    f"{reader.where}: block ring: {name} is {value}, expected {expected}"
                )
        return header

    @property
    def n_waiting(self) -> int:
        """Slots that the device has shown and that were not read yet."""
        return 0 if self._header is None else max(0, ahead(self._header.newest, self._handled))

    async def advance(self, reader: RingReader) -> list[RawBlock]:
        """Read what is new, in order; of much only the first.

        Raises
        ------
        LinkError, FrameError, ConfigError
            As the reader does; nothing is forgotten then.
        """
        header = await self.header(reader)
        await self._enter(reader, header)
        wanted = self._unread(header)
        if not wanted:
            return []
        found = await self._read(reader, header.layout, wanted)
        self._handled = wanted[-1]
        return self._placed(list(zip(wanted, found, strict=True)), header)

    async def _enter(self, reader: RingReader, header: RingHeader) -> None:
        """Find the place to read from, when this is not simply the one after the last."""
        before = self._header
        if before is None:
            self._timeline = Timeline(header.layout, self._epochs)
            self._epochs.begin_first(header.epoch)
            self._handled = header.newest - 1
        elif (before.epoch, before.layout) != (header.epoch, header.layout):
            await self._require_again(reader, header)
            slot = await self._newest_slot(reader, header)
            self._timeline = Timeline(header.layout, self._epochs)
            self._epochs.begin(header.epoch if before.epoch != header.epoch else None)
            if slot is not None:
                self._timeline.anchor(slot)
            self._go_back_to_start(slot, header)
        elif ahead(header.newest, self._handled) < 0:
            slot = await self._newest_slot(reader, header)
            if slot is not None and not self._timeline.repeats(slot):
                self._timeline.restart(slot)
                self._go_back_to_start(slot, header)
        self._header = header

    async def _require_again(self, reader: RingReader, header: RingHeader) -> None:
        """Believe in another epoch only when the device says so twice.

        Otherwise one stale or changed reply would make old samples new.
        """
        again = await self.header(reader)
        if (again.epoch, again.layout) != (header.epoch, header.layout):
            raise FrameError(
                f"{reader.where}: block ring: epoch or layout change from one reading of the header"
                " to the next"
            )

    def _go_back_to_start(self, newest: Slot | None, header: RingHeader) -> None:
        """Stand before the first slot of a new epoch, if the ring still holds it.

        Slots name their epoch, so that all can be looked at when the newest is of no help.
        """
        n_before = header.layout.n_slots
        if newest is not None:
            n_before = newest.first_index // header.layout.samples_per_slot
        self._handled = header.newest - 1 - min(n_before, header.layout.n_slots - 2)

    def _unread(self, header: RingHeader) -> list[int]:
        n_behind = ahead(header.newest, self._handled)
        n_there = min(n_behind, header.layout.n_slots - 1)
        n_wanted = min(n_there, max(1, round(_AT_ONCE_S / header.layout.slot_duration_s)))
        return [(header.newest - n_there + 1 + n) % U32 for n in range(n_wanted)]

    async def _newest_slot(self, reader: RingReader, header: RingHeader) -> Slot | None:
        [slot] = await self._read(reader, header.layout, [header.newest])
        known = slot.epoch == header.epoch and slot.sequence == header.newest
        return slot if known and slot.whole and not slot.blank else None

    async def _read(
        self, reader: RingReader, layout: RingLayout, wanted: Sequence[int]
    ) -> list[Slot]:
        """Read slots, doubtful ones again: the device may be writing them just now."""
        slots = await reader.slots(layout, wanted)
        for i, sequence in enumerate(wanted):
            for _ in range(_N_REREADS):
                if not _doubtful(slots[i], sequence, layout):
                    break
                [slots[i]] = await reader.slots(layout, [sequence])
        return slots

    def _placed(self, found: Sequence[tuple[int, Slot]], header: RingHeader) -> list[RawBlock]:
        blocks = []
        for sequence, slot in found:
            index = self._judge(sequence, slot, header)
            if isinstance(index, Refusal):
                self._rejected[index] += header.layout.samples_per_slot
            elif index is not None:
                blocks.append(self._raw_block(slot, index, header))
        return blocks

    def _judge(self, sequence: int, slot: Slot, header: RingHeader) -> int | Refusal | None:
        """Index of the slot's first sample; None if it was never written or is gone."""
        if slot.blank or _overwritten_or_old(slot, sequence, header.layout):
            return None
        if slot.damage:
            return Refusal.DAMAGED
        if slot.sequence != sequence:
            return Refusal.WRONG_SEQUENCE
        if slot.epoch != header.epoch:
            return None
        if slot.torn:
            return Refusal.TORN
        return self._timeline.place(slot)

    def _raw_block(self, slot: Slot, index: int, header: RingHeader) -> RawBlock:
        rejected = tuple(Rejection(str(r), n) for r, n in self._rejected.items())
        self._rejected.clear()
        return RawBlock(
            epoch=self._epochs.number,
            first_index=index,
            start_ns=slot.start_ns,
            rate_hz=header.layout.rate_mhz / 1000.0,
            counts=slot.counts,
            ok=tuple(bool(slot.ok_bits >> c & 1) for c in range(header.layout.n_channels)),
            slow=slot.slow,
            rejected=rejected,
        )


def _overwritten_or_old(slot: Slot, sequence: int, layout: RingLayout) -> bool:
    """Whether another slot lies here that belongs into the same place."""
    other = slot.sequence != sequence
    return other and slot.sequence % layout.n_slots == sequence % layout.n_slots


def _doubtful(slot: Slot, sequence: int, layout: RingLayout) -> bool:
    """Whether a slot may look different when it is read again."""
    if slot.blank:
        return False
    misplaced = slot.sequence != sequence and not _overwritten_or_old(slot, sequence, layout)
    return misplaced or not slot.whole
