"""`RingSource`: sample source for a DAQ with a ring buffer of samples in Modbus registers."""

from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass

from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival
from acquisition.delivery.blocks import BlockAssembler
from acquisition.delivery.polling import Freshness, incommensurate_period_s
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.requests import READ_HOLDING_REGISTERS
from acquisition.modbus.ring_follower import RingFollower, RingReader
from acquisition.modbus.transport import LinkSettings
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration

_MIN_POLLS_PER_RING = 4
"""Lower limit of the number of polls in the time span of the ring."""

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
        Longest time between polls, above 0; at most a quarter of the time span of the ring is used.
    stale_after_s
        Longest time without a new usable sample before the link counts as lost; above 0. At least
        three slot durations are used.
    """

    function: int = READ_HOLDING_REGISTERS
    base_address: int = 0
    poll_period_s: float = 1.0
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
        self._freshness = Freshness("the newest usable slot", settings.stale_after_s)
        self._n_blocks = 0

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open the link, check the header of the ring, and yield an iterator of sample blocks."""
        async with self._client.connected():
            layout = (await self._follower.header()).layout
            slot_s, ring_s = layout.slot_duration_s, layout.n_slots * layout.slot_duration_s
            stale_after_s = max(self._settings.stale_after_s, _MIN_STALE_SLOTS * slot_s)
            self._freshness.stale_after_s = stale_after_s
            self._freshness.opened(self._clock.monotonic_s())
            longest_s = min(self._settings.poll_period_s, ring_s / _MIN_POLLS_PER_RING)
            period_s = incommensurate_period_s(longest_s, slot_s)
            async with aclosing(self._blocks(period_s, slot_s)) as blocks:
                yield blocks

    async def _blocks(self, period_s: float, slot_s: float) -> AsyncGenerator[SampleBlock, None]:
        due_s = self._clock.monotonic_s()
        while True:
            begun_s = self._clock.monotonic_s()
            found = await self._follower.poll(begun_s)
            arrived = Arrival.now(self._clock)
            n_waiting = self._follower.n_waiting
            read_for_s = arrived.steady_s - begun_s + n_waiting * slot_s
            for block in self._delivery.take(found, arrived, read_for_s):
                yield block
            self._n_blocks += len(found)
            now_s = self._clock.monotonic_s()
            self._freshness.note(str(self._n_blocks).encode(), now_s)
            if not n_waiting or not found:
                due_s = max(due_s + period_s, now_s)  # missed polls are skipped
                await self._clock.sleep(due_s - now_s)
