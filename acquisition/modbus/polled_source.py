"""`PolledSource`: sample source that polls the registers of a Modbus device.

Each poll is one sample. Its index counts poll periods, so that missed polls are a gap of exactly
their number.
"""

import math
from collections.abc import AsyncGenerator, AsyncIterator, Sequence
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass, replace

import numpy as np

from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival, HostStamps
from acquisition.delivery.blocks import BlockAssembler
from acquisition.delivery.polling import Freshness, PollClock
from acquisition.errors import ConfigError
from acquisition.modbus.cells import reads_as
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.decoding import CellDecoder, MapDecoder, MapReading, ValueState
from acquisition.modbus.read_plan import plan_signature
from acquisition.modbus.register_map import RegisterMap
from acquisition.modbus.transport import LinkSettings
from core.samples.blocks import SampleBlock, SideValues
from core.samples.calibration import UNLIMITED, UnitCalibration
from core.spectra.polls import VectorPart, VectorRow

_MIN_STAMP_STEPS = 2.0
"""Minimum poll period in steps of the device clock, so that successive time stamps differ."""

_LARGEST = float(np.finfo(np.float32).max)


class MapReader:
    """Reader of all values of one device's register map; failed requests are not repeated."""

    def __init__(self, settings: LinkSettings, decoder: MapDecoder) -> None:
        self._client, self._decoder = ModbusClient(settings), decoder

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        """Open the link and check identity and signature; close the link on exit of the context.

        Raises
        ------
        LinkError
            If the device does not reply, or replies incorrectly.
        ConfigError
            If identity or signature differ; the message contains found and expected values.
        """
        async with self._client.connected():
            await self._require_signature()
            yield

    async def read(self) -> MapReading:
        """Read and decode all values; raise LinkError if the device does not reply correctly."""
        return self._decoder.read(await self.content())

    async def content(self) -> bytes:
        """Read all registers of the map; return their bytes in the order of `ReadPlan.spans`.

        If connections are not kept, identity and signature are checked first. Raises LinkError if
        the device does not reply correctly, and ConfigError if it is another device.
        """
        if not self._client.is_kept:
            await self._client.require_device()
            await self._require_signature()
        return await self._client.read_spans(self._decoder.plan.spans)

    async def _require_signature(self) -> None:
        signature = self._decoder.map.signature
        plan = plan_signature(self._decoder.map)
        decoder = CellDecoder([part.cell for part in signature], plan)
        numbers = decoder.numbers(await self._client.read_spans(plan.spans))
        for part in signature:
            number = numbers[part.cell]
            if not reads_as(number, part.cell.type, part.expected):
                raise ConfigError(
                    f"{self._client.where}: wrong device: register"
                    f" {part.cell.address} is {number:g}, expected {part.expected:g}"
                )


@dataclass(frozen=True, kw_only=True)
class PolledSettings(LinkSettings):
    """Settings of a polled Modbus device.

    Parameters
    ----------
    poll_period_s
        Time between polls, above 0; the reciprocal of the sampling rate.
    stale_after_s
        Longest time without a change of the device's heartbeat before the link counts as lost; at
        least two poll periods. Without a heartbeat, the device time must change; without a device
        time, any register.
    """

    poll_period_s: float = 1.0
    stale_after_s: float = 60.0


class PolledSource:
    """Sample source that polls the samples, slow values and vectors of one unit.

    Parameters
    ----------
    rows
        Id of the map value of each channel, in the order of the calibration. Slow channels are
        matched by id; a slow channel without a map value is NaN.
    """

    def __init__(
        self,
        settings: PolledSettings,
        registers: RegisterMap,
        rows: Sequence[str],
        calibration: UnitCalibration,
        clock: Clock,
    ) -> None:
        self._clock = clock
        self._rate_hz = 1.0 / settings.poll_period_s
        position = {id_: n for n, id_ in enumerate(registers.ids)}
        self._rows = [position[row] for row in rows]
        self._slow = [position.get(slow.id) for slow in calibration.slow]
        self._full_scale = [
            min(abs(channel.full_scale_v * channel.unit_per_v), _LARGEST)
            for channel in calibration.channels
        ]
        self._reader = MapReader(settings, MapDecoder(registers))
        self._ticks = PollClock(clock, settings.poll_period_s)
        self._freshness = Freshness("the content of the registers", settings.stale_after_s)
        self._stamps = HostStamps(self._rate_hz)
        time = registers.time
        self._stamped = (
            time is not None and settings.poll_period_s >= _MIN_STAMP_STEPS * time.resolution_s
        )
        self._calibration = replace(calibration, rate_hz=self._rate_hz)
        self._delivery = BlockAssembler(
            self._calibration, stamped=self._stamped, samples_when_asked=True
        )

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open the link, check identity and signature, and yield an iterator of sample blocks."""
        async with self._reader.connected():
            self._freshness.opened(self._clock.monotonic_s())
            async with aclosing(self._blocks()) as blocks:
                yield blocks

    async def _blocks(self) -> AsyncGenerator[SampleBlock, None]:
        while True:
            tick = await self._ticks.next()
            polled_ns = self._clock.now_ns()
            reading = await self._reader.read()
            self._freshness.note(reading.alive, self._clock.monotonic_s())
            self._stamps.add(self._ticks.epoch, tick, polled_ns)
            time_ns = reading.time_ns if self._stamped else None
            start_ns = self._stamps.start_ns(tick) if time_ns is None else time_ns
            sample = self._block(reading, tick, start_ns)
            arrived = Arrival.now(self._clock)
            for block in self._delivery.take([sample], arrived, has_stamp=time_ns is not None):
                yield block

    def _block(self, reading: MapReading, index: int, start_ns: int) -> SampleBlock:
        """Return a poll as a block of one sample: NaN if invalid, full scale if clipped."""
        values, states = reading.values[self._rows], np.array(reading.states)[self._rows]
        limits = np.where(values >= 0.0, self._full_scale, np.negative(self._full_scale))
        samples = np.where(states == ValueState.CLIPPED, limits, values)
        samples[(states == ValueState.INVALID) | ~(np.abs(values) <= _LARGEST)] = np.nan
        slow = [math.nan if n is None else slow_number(reading, n) for n in self._slow]
        return SampleBlock(
            calibration=self._calibration,
            epoch=self._ticks.epoch,
            first_index=index,
            counts=samples.astype(np.float32)[:, np.newaxis],
            side=SideValues.of(start_ns, states != ValueState.FLAGGED, slow),
        )


def vector_calibration(
    calibration: UnitCalibration, channels: Sequence[str], rows: Sequence[VectorRow]
) -> UnitCalibration:
    """Return the calibration of a monitoring rack that reports vectors, with one channel per row.

    A block is one poll. Only gap rows have the limits of their transducer; other rows have none.

    Parameters
    ----------
    calibration
        Calibration of the unit's physical channels.
    channels
        Ids of the physical channels, in the order of the calibration.
    rows
        Channel and quantity of each row of a block.

    Raises
    ------
    LookupError
        If a row refers to an unknown channel.
    """
    by_id = dict(zip(channels, calibration.channels, strict=True))
    return replace(
        calibration,
        channels=tuple(
            by_id[row.channel] if row.part is VectorPart.GAP else UNLIMITED for row in rows
        ),
        block_samples=1,
    )


def slow_number(reading: MapReading, position: int) -> float:
    """Return the value with an index in the register map; NaN unless its state is OK."""
    is_ok = reading.states[position] is ValueState.OK
    return float(reading.values[position]) if is_ok else math.nan
