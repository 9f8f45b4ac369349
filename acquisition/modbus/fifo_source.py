"""`FifoSource`: sample source that reads FIFO queues of a Modbus device (function 0x18)."""

import math
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass

from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival, HostStamps
from acquisition.delivery.blocks import BlockAssembler
from acquisition.delivery.polling import Freshness
from acquisition.errors import LinkError
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.fifo_assembly import (
    ChannelAssembly,
    CountedSamples,
    FifoKind,
    FifoLayout,
    FifoPiece,
    PlacedSamples,
    UncountedSamples,
)
from acquisition.modbus.transport import LinkSettings
from core.samples.axis import Epochs
from core.samples.blocks import SampleBlock, SideValues
from core.samples.calibration import UnitCalibration


@dataclass(frozen=True, kw_only=True)
class FifoSettings(LinkSettings):
    """Settings of a Modbus device with FIFO queues.

    Parameters
    ----------
    poll_period_s
        Delay between emptying the queue and the next read, above 0; much shorter than the time in
        which the queue fills.
    stale_after_s
        Longest time without a new sample, or without emptying the queue, before the link counts as
        lost.
    loss_tolerance_s
        Shortest loss of samples that is detected without a counter; shorter ones look like jitter.
    """

    poll_period_s: float = 0.005
    stale_after_s: float = 3.0
    loss_tolerance_s: float = 0.1


class FifoSource:
    """Sample source of one unit that reads FIFO queues.

    A read is never repeated, because it may remove samples. All slow values are NaN.
    """

    def __init__(
        self,
        settings: FifoSettings,
        layout: FifoLayout,
        calibration: UnitCalibration,
        clock: Clock,
    ) -> None:
        self._settings, self._layout = settings, layout
        self._calibration, self._clock = calibration, clock
        self._are_ok = (True,) * len(calibration.channels)
        self._no_slow = (math.nan,) * len(calibration.slow)
        self._client = ModbusClient(settings)
        self._delivery = BlockAssembler(calibration, stamped=False)
        self._stamps = HostStamps(calibration.rate_hz)
        self._freshness = Freshness("the newest sample", settings.stale_after_s)
        self._newest = (0, 0)
        self._connections = 0
        epochs = Epochs(clock.now_ns(), trusts_device=False)
        self._uncounted = UncountedSamples(
            calibration.rate_hz, epochs, tolerance_s=settings.loss_tolerance_s
        )
        self._counted = CountedSamples(calibration.rate_hz, epochs, removes=layout.removes)
        self._channels = ChannelAssembly(layout.n_channels, self._counted)

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open the link and yield an iterator of sample blocks; close the link on exit.

        Iteration raises LinkError if the link is lost, or too slow for the sampling rate.
        """
        async with self._client.connected():
            await self._begin()
            self._freshness.opened(self._clock.monotonic_s())
            async with aclosing(self._blocks()) as blocks:
                yield blocks

    async def _begin(self) -> None:
        """Discard old samples in the queue that could be mistaken for new samples."""
        self._channels.forget()
        uncounted = not self._layout.has_counter
        if uncounted and self._connections:
            self._uncounted.begin()
        self._connections += 1
        if not self._layout.removes:
            return
        if uncounted or self._counted.is_ambiguous(self._clock.monotonic_s()):
            begun_s = self._clock.monotonic_s()
            while not self._is_drained(await self._read()):
                self._require_in_time(self._clock.monotonic_s() - begun_s)

    async def _blocks(self) -> AsyncGenerator[SampleBlock, None]:
        waiting: list[PlacedSamples] = []
        arrived = Arrival.now(self._clock)
        reading_s = 0.0
        while True:
            begun_s = self._clock.monotonic_s()
            try:
                pieces = await self._read()
                arrived = Arrival.now(self._clock)
                waiting += self._place(pieces, arrived.steady_s)
                drained = self._is_drained(pieces)
                reading_s = 0.0 if drained else reading_s + arrived.steady_s - begun_s
                self._require_in_time(reading_s)
            except LinkError:
                if self._layout.has_counter:  # else a loss among these samples cannot be excluded
                    for block in self._delivered(waiting, arrived):  # they cannot be read again
                        yield block
                raise
            if not drained:
                continue
            self._counted.note_drained(arrived.steady_s)
            if not self._layout.has_counter and self._uncounted.has_lost(arrived.steady_s):
                waiting.clear()  # the position of the loss among these samples is unknown
                self._uncounted.begin()
            for block in self._delivered(waiting, arrived):
                yield block
            waiting.clear()
            self._freshness.note(repr(self._newest).encode(), arrived.steady_s)
            await self._clock.sleep(self._settings.poll_period_s)

    def _delivered(self, waiting: list[PlacedSamples], arrived: Arrival) -> list[SampleBlock]:
        """Return the blocks that the samples read up to an arrival complete."""
        newest = {samples.epoch: samples.stop_index for samples in waiting}
        blocks = []
        for samples in waiting:
            if self._newest != (samples.epoch, newest[samples.epoch]):
                self._newest = (samples.epoch, newest[samples.epoch])
                self._stamps.add(*self._newest, arrived.host_ns)
            start_ns = self._stamps.start_ns(samples.first_index)
            side = SideValues.of(start_ns, self._are_ok, self._no_slow)
            blocks.append(
                SampleBlock(
                    self._calibration, samples.epoch, samples.first_index, samples.counts, side
                )
            )
        return self._delivery.take(blocks, arrived)

    async def _read(self) -> list[FifoPiece]:
        contents = await self._client.read_fifos(self._layout.addresses)
        return [self._layout.decode(content) for content in contents]

    def _place(self, pieces: list[FifoPiece], now_s: float) -> list[PlacedSamples]:
        if self._layout.kind is FifoKind.PER_CHANNEL:
            return self._channels.place(pieces, now_s)
        samples = self._counted if self._layout.has_counter else self._uncounted
        return samples.runs(pieces[0], now_s)

    def _is_drained(self, pieces: list[FifoPiece]) -> bool:
        """Return whether a reading emptied the queues; True if reading does not remove samples."""
        full = any(piece.n_samples >= self._layout.most_samples for piece in pieces)
        return not self._layout.removes or not full

    def _require_in_time(self, reading_s: float) -> None:
        if reading_s > self._settings.stale_after_s:
            raise LinkError(
                f"{self._settings.transport}: the FIFO queue has not been empty for"
                f" {self._settings.stale_after_s:g} s; the link is too slow for"
                f" {self._calibration.rate_hz:g} samples/s"
            )
