"""`RingFollower`: which slots of a block ring are new, lost, or refused."""

from collections import Counter
from collections.abc import Sequence
from functools import lru_cache

from acquisition.delivery.blocks import RawBlock
from acquisition.errors import ConfigError, FrameError, LinkError
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.requests import Span
from acquisition.modbus.ring_profile import (
    HEADER_REGISTERS,
    U32,
    RingHeader,
    RingLayout,
    Slot,
    decode_header,
    decode_slots,
)
from acquisition.modbus.timeline import Refusal, Timeline, ahead
from core.samples.axis import Epochs
from core.samples.blocks import Rejection
from core.samples.calibration import UnitCalibration

_N_TRIES = 4
"""A header is short and quickly written; still wrong after this many reads, it is wrong."""


class RingReader:
    """One device's ring as it is found: slots are not judged here."""

    def __init__(self, client: ModbusClient, base_address: int, function: int) -> None:
        self._client = client
        self._header = Span(base_address, HEADER_REGISTERS, function)

    @property
    def where(self) -> str:
        """Host and port, or path of the serial port."""
        return self._client.where

    async def header(self) -> RingHeader:
        """Read and decode the header alone.

        Raises
        ------
        ConfigError
            If this is no block ring.
        LinkError
            As the client does, and if the checksum is wrong, however often it is read.
        """
        for _ in range(_N_TRIES):
            content = await self._client.read_spans([self._header])
            try:
                return decode_header(content)
            except (ConfigError, FrameError) as error:
                fault = error
        kind = ConfigError if isinstance(fault, ConfigError) else LinkError
        raise kind(f"{self.where}: {fault}") from fault

    async def slots(self, layout: RingLayout, sequences: Sequence[int]) -> list[Slot]:
        """Read the places where these sequence numbers belong, whatever lies there.

        Returns
        -------
        list
            One slot for each sequence number.
        """
        spans: list[Span] = []
        for sequence in sequences:
            start, count = layout.slot_address(sequence), layout.slot_registers
            if spans and spans[-1].stop == start:  # no padding between slots
                start, count = spans[-1].address, spans.pop().count + count
            spans.append(Span(start, count, self._header.function))
        return decode_slots(await self._client.read_spans(spans), layout)


_N_REREADS = 3
"""A device needs milliseconds to write a slot; still torn after this many round trips, it lies."""

_MAX_READ_S = 0.5
"""Longest stretch of samples in one poll. A ring that is read after an outage takes a slow line
seconds, and all of it would be read again if that failed before its end."""


class RingFollower:
    """Position of a reader in one device's ring, kept across connections.

    On the first connection it starts with the newest slot. Later it continues after the last slot
    it has handled, as far back as the ring holds; the oldest slot is left alone, because the
    device may be overwriting it.

    Parameters
    ----------
    calibration
        Its channels, rate and slow channels are those that the device must have.
    begun_ns
        When this run of the adapter began, UTC.
    """

    def __init__(self, reader: RingReader, calibration: UnitCalibration, begun_ns: int) -> None:
        self._reader = reader
        self._expected = {
            "n_channels": len(calibration.channels),
            "rate in mHz": round(calibration.rate_hz * 1000.0),
            "n_slow": len(calibration.slow),
        }
        self._header: RingHeader | None = None
        self._timeline: Timeline
        self._epochs = Epochs(begun_ns, trusts_device=True)
        self._handled = 0
        self._rejected: Counter[Refusal] = Counter()

    @property
    def newest(self) -> tuple[int, int] | None:
        """Epoch and newest sequence of the header read last; None before the first."""
        return None if self._header is None else (self._header.epoch, self._header.newest)

    async def header(self) -> RingHeader:
        """Read the header of a device that delivers what is configured.

        Raises
        ------
        ConfigError
            If it does not, naming the field, what was found and what was expected.
        LinkError
            As the reader does.
        """
        header = await self._reader.header()
        ring = header.layout
        found = (ring.n_channels, ring.rate_mhz, ring.n_slow)
        for (name, expected), value in zip(self._expected.items(), found, strict=True):
            if value != expected:
                raise ConfigError(
                    f"{self._reader.where}: block ring: {name} is {value}, expected {expected}"
                )
        return header

    @property
    def n_waiting(self) -> int:
        """Slots up to the newest of the header that were not read yet."""
        return 0 if self._header is None else max(0, ahead(self._header.newest, self._handled))

    async def poll(self) -> list[RawBlock]:
        """Read the new slots, in order; of many only the first.

        Raises
        ------
        LinkError, ConfigError
            As the reader does; the next call then reads the same slots again.
        """
        header = await self.header()
        await self._enter(header)
        wanted = self._unread(header)
        if not wanted:
            return []
        found = await self._read(header.layout, wanted)
        self._handled = wanted[-1]
        return self._placed(list(zip(wanted, found, strict=True)), header)

    async def _enter(self, header: RingHeader) -> None:
        """Set the position to read from where it is not simply the slot after the last."""
        before = self._header
        if before is None:
            self._timeline = Timeline(header.layout, self._epochs)
            self._epochs.begin_first(header.epoch)
            self._handled = header.newest - 1
        elif (before.epoch, before.layout) != (header.epoch, header.layout):
            await self._require_again(header)
            slot = await self._newest_slot(header)
            self._timeline = Timeline(header.layout, self._epochs)
            self._epochs.begin(header.epoch if before.epoch != header.epoch else None)
            if slot is not None:
                self._timeline.anchor(slot)
            self._go_back_to_start(slot, header)
        elif ahead(header.newest, self._handled) < 0:
            slot = await self._newest_slot(header)
            if slot is not None and not self._timeline.repeats(slot):
                self._timeline.restart(slot)
                self._go_back_to_start(slot, header)
        self._header = header

    async def _require_again(self, header: RingHeader) -> None:
        """Accept another epoch only if a second reading of the header has it too.

        Otherwise one stale or changed reply would make old samples new.
        """
        again = await self.header()
        if (again.epoch, again.layout) != (header.epoch, header.layout):
            raise LinkError(
                f"{self._reader.where}: block ring: epoch or layout change from one reading of the"
                " header to the next"
            )

    def _go_back_to_start(self, newest: Slot | None, header: RingHeader) -> None:
        """Set the position to the first slot of a new epoch, if the ring still holds it.

        Slots contain their epoch, so that all can be read if the newest is not usable.
        """
        n_before = header.layout.n_slots
        if newest is not None:
            n_before = newest.first_index // header.layout.samples_per_slot
        self._handled = header.newest - 1 - min(n_before, header.layout.n_slots - 2)

    def _unread(self, header: RingHeader) -> list[int]:
        n_behind = ahead(header.newest, self._handled)
        n_there = min(n_behind, header.layout.n_slots - 1)
        n_wanted = min(n_there, max(1, round(_MAX_READ_S / header.layout.slot_duration_s)))
        return [(header.newest - n_there + 1 + n) % U32 for n in range(n_wanted)]

    async def _newest_slot(self, header: RingHeader) -> Slot | None:
        [slot] = await self._read(header.layout, [header.newest])
        known = slot.epoch == header.epoch and slot.sequence == header.newest
        return slot if known and slot.whole and not slot.blank else None

    async def _read(self, layout: RingLayout, wanted: Sequence[int]) -> list[Slot]:
        """Read slots, and doubtful ones again: the device may be writing them at this moment."""
        slots = await self._reader.slots(layout, wanted)
        for i, sequence in enumerate(wanted):
            for _ in range(_N_REREADS):
                if not _doubtful(slots[i], sequence, layout):
                    break
                [slots[i]] = await self._reader.slots(layout, [sequence])
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
        """Index of the slot's first sample; None if it was never written or is overwritten."""
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
            ok=_verdicts(slot.ok_bits, header.layout.n_channels),
            slow=slot.slow,
            rejected=rejected,
        )


@lru_cache(maxsize=256)
def _verdicts(ok_bits: int, n_channels: int) -> tuple[bool, ...]:
    return tuple(bool(ok_bits >> channel & 1) for channel in range(n_channels))


def _overwritten_or_old(slot: Slot, sequence: int, layout: RingLayout) -> bool:
    """Whether another slot lies here, one that belongs into the same place of the ring."""
    other = slot.sequence != sequence
    return other and slot.sequence % layout.n_slots == sequence % layout.n_slots


def _doubtful(slot: Slot, sequence: int, layout: RingLayout) -> bool:
    """Whether a second reading of the slot may give something else."""
    if slot.blank:
        return False
    misplaced = slot.sequence != sequence and not _overwritten_or_old(slot, sequence, layout)
    return misplaced or not slot.whole
