"""`RingFollower`: reader of the new slots of a block ring; counts refused samples."""

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

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
from core.samples.blocks import Rejection, SampleBlock, SideValues
from core.samples.calibration import UnitCalibration

_N_TRIES = 4
"""Maximum number of attempts to read a valid header; the device may be writing the header."""


class RingReader:
    """Reader of the header and slots of one block ring by `client`; slots are not checked.

    The header begins at `base_address`; `function` is 3 (holding) or 4 (input registers).
    """

    def __init__(self, client: ModbusClient, base_address: int, function: int) -> None:
        self.client = client
        self._header = Span(base_address, HEADER_REGISTERS, function)

    async def header(self) -> RingHeader:
        """Read and decode the header.

        Raises
        ------
        ConfigError
            If the registers contain no valid block-ring header.
        LinkError
            If the device does not reply correctly, or the checksum is wrong in every read.
        """
        for _ in range(_N_TRIES):
            content = await self.client.read_spans([self._header])
            try:
                return decode_header(content)
            except (ConfigError, FrameError) as error:
                fault = error
        kind = ConfigError if isinstance(fault, ConfigError) else LinkError
        raise kind(f"{self.client.where}: {fault}") from fault

    async def header_and_slots(
        self, layout: RingLayout, sequences: Sequence[int]
    ) -> tuple[RingHeader, list[Slot] | None]:
        """Read the header and then slots of a known layout in one exchange; see `slots`.

        The slots are None if the header is invalid or the device has no such registers; the header
        is then read again, with the errors of `header`.
        """
        spans = [self._header, *self._slot_spans(layout, sequences)]
        try:
            content = await self.client.read_spans(spans)
            header = decode_header(content)
        except (ConfigError, FrameError):
            return await self.header(), None
        return header, decode_slots(content[self._header.n_bytes :], layout)

    async def slots(self, layout: RingLayout, sequences: Sequence[int]) -> list[Slot]:
        """Read the slots at the ring positions of sequence numbers; each may be another slot."""
        spans = self._slot_spans(layout, sequences)
        return decode_slots(await self.client.read_spans(spans), layout)

    def _slot_spans(self, layout: RingLayout, sequences: Sequence[int]) -> list[Span]:
        n_registers, starts, stops = layout.slot_registers, [], [-1]
        for start in map(layout.slot_address, sequences):
            if start == stops[-1]:  # no padding between slots
                stops.pop()
            else:
                starts.append(start)
            stops.append(start + n_registers)
        function = self._header.function
        return [Span(a, b - a, function) for a, b in zip(starts, stops[1:], strict=True)]


_N_REREADS = 3
"""Maximum number of repeated reads of a torn slot; a slot is written in milliseconds."""

_MAX_READ_S, _MIN_READ_S = 1.5, 0.05
"""Maximum duration of the samples in one poll, s; halved after each failure in succession down to
the second value, so that a bad line is not lost again and again at the last slot."""


class RingFollower:
    """Reader of the new slots of one block ring; keeps its position across connections.

    The first connection starts with the newest slot. Later connections continue after the last
    slot that was read, as far as the ring still contains it. The oldest slot is never read,
    because the device may be overwriting it.

    Parameters
    ----------
    calibration
        Calibration of the unit; the device must have its channels, slow channels and rate.
    begun_ns
        Start time of this source, UTC ns since 1970; for the numbers of the epochs.
    """

    def __init__(self, reader: RingReader, calibration: UnitCalibration, begun_ns: int) -> None:
        self._reader, self._client = reader, reader.client
        self._calibration = calibration
        self._header: RingHeader | None = None
        self._asked_s, self._max_read_s = 0.0, _MAX_READ_S
        self._timeline: Timeline
        self._epochs = Epochs(begun_ns, trusts_device=True)
        self._handled = 0
        self._rejected: Counter[Refusal] = Counter()

    async def header(self) -> RingHeader:
        """Read the header, with the errors of `RingReader.header` and `_required`."""
        return self._required(await self._reader.header())

    def _required(self, header: RingHeader) -> RingHeader:
        """Return a header; raise ConfigError if its channels or rate are not those calibrated."""
        ring, own = header.layout, self._calibration
        for name, value, expected in (
            ("n_channels", ring.n_channels, len(own.channels)),
            ("rate in mHz", ring.rate_mhz, round(own.rate_hz * 1000.0)),
            ("n_slow", ring.n_slow, len(own.slow)),
        ):
            if value != expected:
                raise ConfigError(
                    f"{self._client.where}: block ring: {name} of the device is {value},"
                    f" of the plant file {expected}"
                )
        return header

    @property
    def n_waiting(self) -> int:
        """Number of unread slots up to the newest slot of the last header."""
        return 0 if self._header is None else max(0, ahead(self._header.newest, self._handled))

    async def poll(self, now_s: float) -> list[SampleBlock]:
        """Read new slots at a monotonic time, oldest first; return the accepted samples.

        Each block is a run of consecutive slots, with one cell per slot; the list may be empty.
        After an error of `RingReader`, the next call reads the same slots again.
        """
        max_read_s = self._max_read_s
        self._max_read_s = max(_MIN_READ_S, max_read_s / 2.0)  # unless this poll succeeds
        blocks = await self._blocks(now_s, self._due(now_s, max_read_s), max_read_s)
        self._max_read_s = min(_MAX_READ_S, 2.0 * max_read_s)
        return blocks

    async def _blocks(
        self, now_s: float, due: Sequence[int], max_read_s: float
    ) -> list[SampleBlock]:
        before, slots = self._header, None
        self._asked_s = now_s
        if before is not None and due:
            found, slots = await self._reader.header_and_slots(before.layout, due)
            header = self._required(found)
            slots = slots if header.layout == before.layout else None
        else:
            header = await self.header()
        await self._enter(header)
        wanted = self._unread(header, max_read_s)
        if not wanted:
            return []
        if slots is not None and due[0] == wanted[0]:
            wanted = wanted[: len(due)]
            slots = slots[: len(wanted)]
        else:
            slots = await self._reader.slots(header.layout, wanted)
        await self._reread(slots, header.layout, wanted)
        self._handled = wanted[-1]
        return self._placed(list(zip(wanted, slots, strict=True)), header)

    def _due(self, now_s: float, max_read_s: float) -> list[int]:
        """Return the slots that may have been written by now, if they can be read with the header.

        They can be if requests need not wait for replies. The header is read first: slots that it
        does not contain are not used. Where polls are shorter than slots, only slots of the last
        header are due; others would be read in vain.
        """
        if self._header is None or self._client.requests_in_flight == 1:
            return []
        layout = self._header.layout
        n_new = (now_s - self._asked_s) / layout.slot_duration_s
        n_due = self.n_waiting + (math.ceil(n_new) if n_new >= 1.0 else 0)
        if n_due >= layout.n_slots:  # the oldest of them may be overwritten
            return []
        return [(self._handled + 1 + n) % U32 for n in range(_n_read(n_due, layout, max_read_s))]

    async def _enter(self, header: RingHeader) -> None:
        """Set the read position at the start, after a restart, or if the sequence went back."""
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
        """Read the header again; raise LinkError if a changed epoch or layout is not confirmed.

        Otherwise one stale or corrupted reply would start a new epoch with old samples.
        """
        again = await self.header()
        if (again.epoch, again.layout) != (header.epoch, header.layout):
            raise LinkError(
                f"{self._client.where}: block ring: epoch or layout differ between two reads of"
                " the header; if this recurs, check the device"
            )

    def _go_back_to_start(self, newest: Slot | None, header: RingHeader) -> None:
        """Set the read position to the first slot of a new epoch, or to the oldest readable slot.

        Each slot contains its epoch, so that all slots can be read if the newest is unusable.
        """
        n_before = header.layout.n_slots
        if newest is not None:
            n_before = newest.first_index // header.layout.samples_per_slot
        self._handled = header.newest - 1 - min(n_before, header.layout.n_slots - 2)

    def _unread(self, header: RingHeader, max_read_s: float) -> list[int]:
        n_behind = ahead(header.newest, self._handled)
        n_there = min(n_behind, header.layout.n_slots - 1)
        n_wanted = _n_read(n_there, header.layout, max_read_s)
        return [(header.newest - n_there + 1 + n) % U32 for n in range(n_wanted)]

    async def _newest_slot(self, header: RingHeader) -> Slot | None:
        slots = await self._reader.slots(header.layout, [header.newest])
        await self._reread(slots, header.layout, [header.newest])
        [slot] = slots
        known = slot.epoch == header.epoch and slot.sequence == header.newest
        return slot if known and slot.whole and not slot.blank else None

    async def _reread(self, slots: list[Slot], layout: RingLayout, wanted: Sequence[int]) -> None:
        """Repeat the read of inconsistent slots, which the device may be writing."""
        for n, sequence in enumerate(wanted):
            for _ in range(_N_REREADS):
                if not _doubtful(slots[n], sequence, layout):
                    break
                [slots[n]] = await self._reader.slots(layout, [sequence])

    def _placed(self, found: Sequence[tuple[int, Slot]], header: RingHeader) -> list[SampleBlock]:
        """Return the accepted slots, with consecutive slots joined to one block."""
        runs: list[tuple[int, int, Counter[Refusal], list[Slot]]] = []
        n_samples, follows = header.layout.samples_per_slot, (-1, -1)
        for sequence, slot in found:
            index = self._judge(sequence, slot, header)
            if isinstance(index, Refusal):
                self._rejected[index] += n_samples
            elif index is not None:
                epoch = self._epochs.number
                if self._rejected or (epoch, index) != follows:
                    runs.append((epoch, index, self._rejected, []))
                    self._rejected = Counter()
                runs[-1][-1].append(slot)
                follows = (epoch, index + n_samples)
        return [self._block(*run) for run in runs]

    def _judge(self, sequence: int, slot: Slot, header: RingHeader) -> int | Refusal | None:
        """Return the index of a slot's first sample, or the reason for refusing the slot.

        None for a slot that is blank, or of another turn of the ring or another epoch.
        """
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

    def _block(
        self, epoch: int, index: int, rejected: Counter[Refusal], slots: Sequence[Slot]
    ) -> SampleBlock:
        counts = np.concatenate([slot.counts for slot in slots], axis=1)
        ok_bits = np.array([slot.ok_bits for slot in slots])
        return SampleBlock(
            calibration=self._calibration,
            epoch=epoch,
            first_index=index,
            counts=counts,
            side=SideValues(
                starts=np.arange(0, counts.shape[1], slots[0].counts.shape[1]),
                start_ns=np.array([slot.start_ns for slot in slots]),
                ok=(ok_bits >> np.arange(len(counts))[:, np.newaxis] & 1).astype(np.bool_),
                slow=np.array([slot.slow for slot in slots]).T,
            ),
            rejected=tuple(Rejection(str(reason), n) for reason, n in rejected.items()),
        )


def _n_read(n_slots: int, layout: RingLayout, max_read_s: float) -> int:
    """Return how many of `n_slots` slots are read, at least one of them."""
    return min(n_slots, max(1, round(max_read_s / layout.slot_duration_s)))


def _overwritten_or_old(slot: Slot, sequence: int, layout: RingLayout) -> bool:
    """Return whether the ring position contains a slot of an earlier or later turn of the ring."""
    other = slot.sequence != sequence
    return other and slot.sequence % layout.n_slots == sequence % layout.n_slots


def _doubtful(slot: Slot, sequence: int, layout: RingLayout) -> bool:
    """Return whether a slot is torn, damaged or misplaced, so that a second read may differ."""
    if slot.blank:
        return False
    misplaced = slot.sequence != sequence and not _overwritten_or_old(slot, sequence, layout)
    return misplaced or not slot.whole
