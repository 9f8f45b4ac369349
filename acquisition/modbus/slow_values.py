"""`PolledSlowValues`: slow values of one device, polled beside another device's waveforms."""

import asyncio
import random
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager

from acquisition.clock import Clock
from acquisition.delivery.calibration import SlowCalibration, slow_reading
from acquisition.delivery.polling import Freshness, wrong_replies_drop_the_link
from acquisition.errors import AcquisitionError, ConfigError
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.decoding import MapDecoder, MapReading
from acquisition.modbus.polled_source import MapReader, PolledSettings, slow_number
from acquisition.modbus.register_map import RegisterMap
from core.quality import Reading, Reason, missing

_MIN_RETRY_S = 1.0
_CONFIG_RETRY_S = 15.0


class PolledSlowValues:
    """The newest slow values of a device.

    Other than a source it tries a lost link again by itself, about once a poll period: the unit
    goes on without it, so that nobody else would.

    Parameters
    ----------
    channels
        The slow channels that it measures.

    Attributes
    ----------
    trouble
        Why it has no values, in words; None while it has.

    Raises
    ------
    ConfigError
        If the map cannot be read, lacks a channel, or wants to be asked less often.
    """

    def __init__(
        self,
        settings: PolledSettings,
        registers: RegisterMap,
        channels: Sequence[SlowCalibration],
        clock: Clock,
    ) -> None:
        settings.require_fit(registers)
        self._settings, self._clock = settings, clock
        self._decoder = MapDecoder(registers)
        self._channels = channels
        for channel in channels:
            if channel.id not in registers.ids:
                raise ConfigError(f"modbus: the register map has no value for {channel.id!r}")
        self._freshness = Freshness("nothing that is read", settings.stale_after_s)
        self._newest: tuple[float, Mapping[str, Reading]] | None = None
        self._task: asyncio.Task[None] | None = None
        self._asked = asyncio.Event()
        self.trouble: str | None = "not asked yet"

    @asynccontextmanager
    async def watch(self) -> AsyncIterator[None]:
        """Poll in the background until the context is left; the very first poll is waited for."""
        self._task = task = asyncio.create_task(self._run(), name="poll slow values")
        try:
            await self._asked.wait()
            self._raise_a_bug()
            yield
        finally:
            task.cancel()
            await asyncio.wait([task])
            self._raise_a_bug()

    def current(self) -> Mapping[str, Reading]:
        """The newest values, or why there are none: not connected, or too old."""
        self._raise_a_bug()
        if self._newest is None:
            return self._missing(Reason.NOT_CONNECTED)
        polled_s, readings = self._newest
        if self._clock.monotonic_s() - polled_s <= self._settings.stale_after_s:
            return readings
        return self._missing(Reason.STALE if self.trouble is None else Reason.NOT_CONNECTED)

    def _raise_a_bug(self) -> None:
        """Let nothing but lost links pass in silence."""
        if self._task is not None and self._task.done() and not self._task.cancelled():
            self._task.result()

    def _missing(self, reason: Reason) -> Mapping[str, Reading]:
        return {channel.id: missing(reason) for channel in self._channels}

    async def _run(self) -> None:
        while True:
            try:
                await self._poll()
            except AcquisitionError as error:
                self.trouble = str(error)
                await self._clock.sleep(self._retry_s(error))

    def _retry_s(self, error: AcquisitionError) -> float:
        least_s = _CONFIG_RETRY_S if isinstance(error, ConfigError) else _MIN_RETRY_S
        # devices that vanish together must not be called back together
        return max(self._settings.poll_period_s, least_s) * random.uniform(1.0, 1.5)  # noqa: S311

    async def _poll(self) -> None:
        """Open the link and poll until something goes wrong."""
        link = ModbusClient(self._settings)
        try:
            with wrong_replies_drop_the_link():
                await link.open()
                reader = MapReader(link, self._decoder)
                await reader.require_signature()
                self._freshness.opened(self._clock.monotonic_s())
                while True:
                    reading = await reader.read()
                    now_s = self._clock.monotonic_s()
                    self._freshness.note(reading.alive, now_s)
                    self._newest = (now_s, self._readings(reading))
                    self.trouble = None
                    self._asked.set()
                    await self._clock.sleep(self._settings.poll_period_s)
        finally:
            self._asked.set()
            link.close()

    def _readings(self, reading: MapReading) -> Mapping[str, Reading]:
        ids = self._decoder.map.ids
        return {
            channel.id: slow_reading(slow_number(reading, ids.index(channel.id)), channel)
            for channel in self._channels
        }
