"""Slow values of a separate device, polled in addition to the waveforms of another device."""

import asyncio
import random
from collections.abc import AsyncGenerator, AsyncIterator, Mapping, Sequence
from contextlib import aclosing, asynccontextmanager
from dataclasses import replace

from acquisition.clock import Clock
from acquisition.delivery.polling import Freshness
from acquisition.errors import AcquisitionError, ConfigError
from acquisition.modbus.decoding import MapDecoder, MapReading
from acquisition.modbus.polled_source import MapReader, PolledSettings, slow_number
from acquisition.modbus.register_map import RegisterMap
from acquisition.source import SampleSource, refused_frames_of
from core.quality import Reading, Reason, missing
from core.samples.blocks import SampleBlock
from core.samples.calibration import SlowCalibration, UnitCalibration

_MIN_RETRY_S = 1.0
_CONFIG_RETRY_S = 15.0


class PolledSlowValues:
    """Poller of one device that keeps its newest slow values.

    Unlike a source, the poller reopens a lost link itself, about once per poll period, because the
    unit continues without these values.

    Parameters
    ----------
    channels
        Slow channels that the device measures.

    Attributes
    ----------
    trouble
        Reason for missing values, in words; None while values are available.
    """

    def __init__(
        self,
        settings: PolledSettings,
        registers: RegisterMap,
        channels: Sequence[SlowCalibration],
        clock: Clock,
    ) -> None:
        self._settings, self._clock = settings, clock
        self._reader = MapReader(settings, MapDecoder(registers))
        position = {id_: n for n, id_ in enumerate(registers.ids)}
        self._channels = {position[channel.id]: channel for channel in channels}
        self._freshness = Freshness("the content of the registers", settings.stale_after_s)
        self._newest: tuple[float, Mapping[str, Reading]] | None = None
        self._task: asyncio.Task[None] | None = None
        self._tried = asyncio.Event()
        self.trouble: str | None = "not polled yet"

    @asynccontextmanager
    async def watch(self) -> AsyncIterator[None]:
        """Poll in a background task until the context exits; entry waits for the first attempt."""
        self._task = task = asyncio.create_task(self._run(), name="poll slow values")
        try:
            await self._tried.wait()
            self._raise_bug()
            yield
        finally:
            task.cancel()
            await asyncio.wait([task])
            self._raise_bug()

    def current(self) -> Mapping[str, Reading]:
        """Return the newest reading (value and quality) of each slow channel, by channel id.

        If the newest poll is too old, or none has succeeded, readings have a reason but no value.
        """
        self._raise_bug()
        if self._newest is None:
            return self._missing(Reason.NOT_CONNECTED)
        polled_s, readings = self._newest
        if self._clock.monotonic_s() - polled_s <= self._settings.stale_after_s:
            return readings
        return self._missing(Reason.STALE if self.trouble is None else Reason.NOT_CONNECTED)

    def _raise_bug(self) -> None:
        """Raise the exception that has ended the polling task; link errors do not end it."""
        if self._task is not None and self._task.done() and not self._task.cancelled():
            self._task.result()

    def _missing(self, reason: Reason) -> Mapping[str, Reading]:
        return {channel.id: missing(reason) for channel in self._channels.values()}

    async def _run(self) -> None:
        while True:
            try:
                await self._poll()
            except AcquisitionError as error:
                self.trouble = str(error)
                await self._clock.sleep(self._retry_s(error))

    def _retry_s(self, error: AcquisitionError) -> float:
        min_s = _CONFIG_RETRY_S if isinstance(error, ConfigError) else _MIN_RETRY_S
        # devices that fail together are not reopened at the same moment
        return max(self._settings.poll_period_s, min_s) * random.uniform(1.0, 1.5)  # noqa: S311

    async def _poll(self) -> None:
        """Open the link and poll until an error occurs."""
        try:
            async with self._reader.connected():
                self._freshness.opened(self._clock.monotonic_s())
                while True:
                    reading = await self._reader.read()
                    now_s = self._clock.monotonic_s()
                    self._freshness.note(reading.alive, now_s)
                    self._newest = (now_s, self._readings(reading))
                    self.trouble = None
                    self._tried.set()
                    await self._clock.sleep(self._settings.poll_period_s)
        finally:
            self._tried.set()

    def _readings(self, reading: MapReading) -> Mapping[str, Reading]:
        return {
            channel.id: channel.reading(slow_number(reading, n))
            for n, channel in self._channels.items()
        }


class JoinedSource:
    """Source that adds the current slow values of a second device to each waveform block.

    If the slow device is lost or faulty, its readings have a reason but no value, and the waveforms
    continue. The slow device is polled only while the waveform source is connected, so that retries
    of the waveform link do not reconnect it.
    """

    def __init__(self, source: SampleSource, slow: PolledSlowValues) -> None:
        self._source, self._slow = source, slow

    @property
    def refused_frames(self) -> Mapping[str, int]:
        """Number of rejected frames of the waveform source, by reason."""
        return refused_frames_of(self._source)

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open both links, with the errors of the waveform source; close them on exit."""
        async with (
            self._source.connect() as blocks,
            self._slow.watch(),
            aclosing(self._joined(blocks)) as joined,
        ):
            yield joined

    async def _joined(
        self, blocks: AsyncIterator[SampleBlock]
    ) -> AsyncGenerator[SampleBlock, None]:
        async for block in blocks:
            yield replace(block, elsewhere={**block.elsewhere, **self._slow.current()})


def without_slow(calibration: UnitCalibration, ids: frozenset[str]) -> UnitCalibration:
    """Return the calibration of the waveform device, without the slow channels `ids`."""
    slow = tuple(channel for channel in calibration.slow if channel.id not in ids)
    return replace(calibration, slow=slow)
