"""`RingSource`: sample source for a DAQ with a ring buffer of samples in Modbus registers."""

from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass

from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival
from acquisition.delivery.blocks import BlockAssembler
from acquisition.delivery.polling import incommensurate_period_s
from acquisition.errors import LinkError
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.requests import READ_HOLDING_REGISTERS
from acquisition.modbus.ring_follower import RingFollower, RingReader
from acquisition.modbus.transport import LinkSettings
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration

_MIN_STALE_SLOTS = 3
"""Lower limit of the effective `RingSettings.stale_after_s`, in slot durations."""


@dataclass(frozen=True, kw_only=True)
class RingSettings(LinkSettings):
    """Settings of a Modbus device with a block ring (a ring buffer of slots of samples).

    Parameters
    ----------
    function
        3 (holding registers) or 4 (input registers).
    base_address
        Register address of the header, counted from 0.
    poll_period_s
        Longest time between polls, above 0; much shorter than the time span of the ring.
    stale_after_s
        Longest time without a new usable sample before the link counts as lost; above 0. At least
        three slot durations are used.
    """

    function: int = READ_HOLDING_REGISTERS
    base_address: int = 0
    poll_period_s: float = 0.5
    stale_after_s: float = 5.0


class RingSource:
    """Sample source of one unit that reads a block ring; keeps its position across connections."""

    def __init__(self, settings: RingSettings, calibration: UnitCalibration, clock: Clock) -> None:
        self._settings = settings
        self._client = ModbusClient(settings)
        self._delivery = BlockAssembler(calibration)
        self._clock = clock
        reader = RingReader(self._client, settings.base_address, settings.function)
        self._follower = RingFollower(reader, calibration, begun_ns=clock.now_ns())
        self._fresh_at_s = 0.0
        self._stale_after_s = settings.stale_after_s
        self._slot_s = 0.0

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open the link, check the header of the ring, and yield blocks; see `SampleSource`."""
        async with self._client.connected():
            await self._identify()
            async with aclosing(self._blocks()) as blocks:
                yield blocks

    async def _identify(self) -> None:
        header = await self._follower.header()
        self._slot_s = header.layout.slot_duration_s
        self._stale_after_s = max(self._settings.stale_after_s, _MIN_STALE_SLOTS * self._slot_s)
        if self._follower.newest == (header.epoch, header.newest):
            self._require_fresh()
        else:
            self._fresh_at_s = self._clock.monotonic_s()

    async def _blocks(self) -> AsyncGenerator[SampleBlock, None]:
        period_s = incommensurate_period_s(self._settings.poll_period_s, self._slot_s)
        due_s = self._clock.monotonic_s()
        while True:
            begun_s = self._clock.monotonic_s()
            found = await self._follower.poll()
            arrived = Arrival.now(self._clock)
            n_waiting = self._follower.n_waiting
            read_for_s = arrived.steady_s - begun_s + n_waiting * self._slot_s
            for block in self._delivery.take(found, arrived, read_for_s):
                yield block
            if found:
                self._fresh_at_s = self._clock.monotonic_s()
                if n_waiting:
                    continue
            else:
                self._require_fresh()
            now_s = self._clock.monotonic_s()
            due_s = max(due_s + period_s, now_s)  # missed polls are skipped
            await self._clock.sleep(due_s - now_s)

    def _require_fresh(self) -> None:
        standing_s = self._clock.monotonic_s() - self._fresh_at_s
        if standing_s > self._stale_after_s and self._follower.newest is not None:
            epoch, newest = self._follower.newest
            raise LinkError(
                f"{self._settings.transport}: the device replies, but has sent no usable slot for"
                f" {standing_s:.1f} s; the newest slot is {newest} of epoch {epoch}"
            )
