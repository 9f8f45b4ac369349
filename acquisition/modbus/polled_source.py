"""`PolledSource`: registers that are read again and again as a sample source.

A sample is a poll, its index the number of the poll's tick: whatever was missed is an exact jump.
"""

from collections.abc import AsyncGenerator, AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass

import numpy as np

from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival, HostStamps
from acquisition.delivery.blocks import BlockAssembler
from acquisition.delivery.calibration import ChannelCalibration, UnitCalibration
from acquisition.delivery.polling import Freshness, PollClock, wrong_replies_drop_the_link
from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.modbus.cells import BIT_FUNCTIONS, reads_as
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.decoding import CellDecoder, MapDecoder, MapReading, ValueState
from acquisition.modbus.read_plan import ReadPlan, plan_signature
from acquisition.modbus.register_map import RegisterMap
from acquisition.modbus.transport import LinkSettings
from core.samples.blocks import SampleBlock


class MapReader:
    """One device's map. One request is outstanding at a time, and none is repeated."""

    def __init__(self, link: ModbusClient, decoder: MapDecoder) -> None:
        self._link, self._decoder = link, decoder

    async def read(self) -> MapReading:
        """Read everything once; from the right device, also if connections are not kept.

        Raises
        ------
        LinkError, FrameError, ConfigError
            As the link does.
        """
        if not self._link.is_kept:
            await self._link.require_device()
            await self.require_signature()
        return self._decoder.read(await self.content())

    async def content(self) -> bytes:
        """All replies, one after the other."""
        return await self._replies(self._decoder.plan)

    async def require_signature(self) -> None:
        """Refuse a device that is another one than configured.

        Raises
        ------
        ConfigError
            Naming register, what was found and what was expected.
        """
        signature = self._decoder.map.signature
        plan = plan_signature(self._decoder.map)
        decoder = CellDecoder([s.cell for s in signature], plan)
        found = decoder.numbers(await self._replies(plan))
        for part, number in zip(signature, found.tolist(), strict=True):
            if not reads_as(number, part.cell.type, part.expected):
                raise ConfigError(
                    f"{self._link.where}: another device than configured: register"
                    f" {part.cell.address} is {number:g}, expected {part.expected:g}"
                )

    async def _replies(self, plan: ReadPlan) -> bytes:
        replies = []
        for request in plan.requests:
            read = self._link.read_bits if request.function in BIT_FUNCTIONS else self._link.read
            replies.append(await read(request.start, request.count, request.function))
        return b"".join(replies)


_LEAST_STAMP_STEPS = 2.0
"""A device's clock must tell neighbouring polls apart, or its stamps would seem to stand still."""

_LARGEST = float(np.finfo(np.float32).max)


@dataclass(frozen=True, kw_only=True)
class PolledSettings(LinkSettings):
    """A device whose registers are polled.

    Parameters
    ----------
    poll_period_s
        Time between polls, above 0: one over the sampling rate.
    stale_after_s
        A device in which nothing changes for longer than this is not connected: its heartbeat, else
        its time, else everything that is read. At least two poll periods.
    """

    poll_period_s: float = 1.0
    stale_after_s: float = 60.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.poll_period_s < float("inf"):
            raise ConfigError(f"modbus: poll_period_s is {self.poll_period_s}, must be above 0")
        if not 2.0 * self.poll_period_s <= self.stale_after_s:
            raise ConfigError(
                f"modbus: stale_after_s is {self.stale_after_s}, must be at least two poll periods"
            )

    def require_fit(self, registers: RegisterMap) -> None:
        """Refuse to ask a device faster than its manual allows.

        Raises
        ------
        ConfigError
            With what is allowed.
        """
        for key, least in (
            ("poll_period_s", registers.min_poll_period_s),
            ("timeout_s", registers.min_timeout_s),
        ):
            if getattr(self, key) < least:
                found = getattr(self, key)
                raise ConfigError(f"modbus: {key} is {found}, the map asks for {least} or more")
        if self.max_registers < registers.max_registers:
            raise ConfigError(
                f"modbus: max_registers is {self.max_registers}, the map reads up to"
                f" {registers.max_registers} at once"
            )


class PolledSource:
    """Samples, slow values and vectors of one unit from polled registers.

    Parameters
    ----------
    rows
        Which value of the map each row of a block is, by id; as many as the calibration has
        channels. Its slow channels are found by their own ids; one that the map lacks is not
        measured here.

    Raises
    ------
    ConfigError
        If the map cannot be read, lacks a row, or wants to be asked less often.
    """

    def __init__(
        self,
        settings: PolledSettings,
        registers: RegisterMap,
        rows: Sequence[str],
        calibration: UnitCalibration,
        clock: Clock,
    ) -> None:
        settings.require_fit(registers)
        self._settings, self._clock = settings, clock
        self._decoder = MapDecoder(registers)
        self._assembly = _Assembly(registers, rows, calibration, 1.0 / settings.poll_period_s)
        self._ticks = PollClock(clock, settings.poll_period_s)
        self._freshness = Freshness("nothing that is read", settings.stale_after_s)
        self._stamps = HostStamps(1.0 / settings.poll_period_s)
        time = registers.time
        self._stamped = (
            time is not None and settings.poll_period_s >= _LEAST_STAMP_STEPS * time.resolution_s
        )
        self._delivery = BlockAssembler(calibration, stamped=self._stamped, samples_when_asked=True)

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open the link and identify the device; leaving the context closes the link.

        Raises
        ------
        LinkError
            If the device does not answer, answers nonsense, or its data stand still.
        ConfigError
            If it is not the configured device, or lacks a register.
        """
        link = ModbusClient(self._settings)
        try:
            with wrong_replies_drop_the_link():
                await link.open()
                reader = MapReader(link, self._decoder)
                await reader.require_signature()
            self._freshness.opened(self._clock.monotonic_s())
            blocks = self._blocks(reader)
            try:
                yield blocks
            finally:
                await blocks.aclose()
        finally:
            link.close()

    async def _blocks(self, reader: MapReader) -> AsyncGenerator[SampleBlock, None]:
        while True:
            tick = await self._ticks.next()
            polled_ns = self._clock.now_ns()
            with wrong_replies_drop_the_link():
                reading = await reader.read()
            self._freshness.note(reading.alive, self._clock.monotonic_s())
            self._stamps.add(self._ticks.epoch, tick, polled_ns)
            time_ns = reading.time_ns if self._stamped else None
            start_ns = self._stamps.start_ns(tick) if time_ns is None else time_ns
            raw = self._assembly.block(reading, self._ticks.epoch, tick, start_ns)
            arrived = Arrival.now(self._clock)
            for block in self._delivery.take(raw, arrived, has_stamp=time_ns is not None):
                yield block


class _Assembly:
    """From the values of a map to a raw block of one sample."""

    def __init__(
        self,
        registers: RegisterMap,
        rows: Sequence[str],
        calibration: UnitCalibration,
        rate_hz: float,
    ) -> None:
        place = {id_: n for n, id_ in enumerate(registers.ids)}
        for row in rows:
            if row not in place:
                raise ConfigError(f"modbus: the register map has no value for {row!r}")
        if len(rows) != len(calibration.channels):
            raise ConfigError(f"modbus: {len(rows)} rows for {len(calibration.channels)} channels")
        self._rate_hz = rate_hz
        self._rows = [place[row] for row in rows]
        self._slow = [place.get(slow.id) for slow in calibration.slow]
        self._full_scale = [_full_scale(channel) for channel in calibration.channels]

    def block(self, reading: MapReading, epoch: int, index: int, start_ns: int) -> RawBlock:
        cells = [
            _sample(float(reading.values[n]), reading.states[n], full_scale)
            for n, full_scale in zip(self._rows, self._full_scale, strict=True)
        ]
        return RawBlock(
            epoch=epoch,
            first_index=index,
            start_ns=start_ns,
            rate_hz=self._rate_hz,
            counts=np.array(cells, dtype=np.float32)[:, np.newaxis],
            ok=tuple(reading.states[n] is not ValueState.FLAGGED for n in self._rows),
            slow=tuple(slow_number(reading, n) for n in self._slow),
        )


def slow_number(reading: MapReading, place: int | None) -> float:
    """A slow value, not a number where there is none that may be believed."""
    if place is None or reading.states[place] is not ValueState.OK:
        return float("nan")
    return float(reading.values[place])


def _full_scale(channel: ChannelCalibration) -> float:
    return min(abs(channel.full_scale_v * channel.unit_per_v), _LARGEST)


def _sample(value: float, state: ValueState, full_scale: float) -> float:
    """What calibration understands: no number, or one at full scale, or the device's own."""
    if state is ValueState.INVALID or not abs(value) <= _LARGEST:
        return float("nan")
    if state is ValueState.CLIPPED:
        return full_scale if value >= 0.0 else -full_scale
    return value
