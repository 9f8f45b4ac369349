"""`ModbusRingSource`: a DAQ with a block ring as a sample source."""

from collections.abc import AsyncGenerator, AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass

from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival
from acquisition.delivery.blocks import BlockAssembler
from acquisition.delivery.calibration import UnitCalibration
from acquisition.delivery.polling import incommensurate_period_s
from acquisition.errors import ConfigError, FrameError, LinkError
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.requests import READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS
from acquisition.modbus.ring_follower import RingFollower, RingReader
from acquisition.modbus.ring_profile import HEADER_REGISTERS
from acquisition.modbus.transport import ADDRESS_SPACE, LinkSettings
from core.samples.blocks import SampleBlock

_MIN_STALE_SLOTS = 3
"""A device with long slots may be silent for more than a slot without being stale."""


@dataclass(frozen=True, kw_only=True)
class ModbusRingSettings(LinkSettings):
    """A block ring behind a Modbus device.

    Parameters
    ----------
    function
        3 (holding registers) or 4 (input registers).
    base_address
        Register address of the header, counted from 0.
    poll_period_s
        Longest time between polls, above 0; the ring must hold much more than that.
    stale_after_s
        A device without a usable new sample for longer than this is not connected; above 0.
    """

    function: int = READ_HOLDING_REGISTERS
    base_address: int = 0
    poll_period_s: float = 0.5
    stale_after_s: float = 5.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.function not in (READ_HOLDING_REGISTERS, READ_INPUT_REGISTERS):
            raise ConfigError(f"modbus: function is {self.function}, allowed are 3 and 4")
        if not 0 <= self.base_address <= ADDRESS_SPACE - HEADER_REGISTERS:
            raise ConfigError(
                f"modbus: base_address is {self.base_address},"
                f" allowed is 0 to {ADDRESS_SPACE - HEADER_REGISTERS}"
            )
        for name, value in (
            ("poll_period_s", self.poll_period_s),
            ("stale_after_s", self.stale_after_s),
        ):
            if not 0 < value < float("inf"):
                raise ConfigError(f"modbus: {name} is {value}, must be above 0")


class ModbusRingSource:
    """Samples of one unit from a block ring; remembers where it stood when connected again."""

    def __init__(
        self, settings: ModbusRingSettings, calibration: UnitCalibration, clock: Clock
    ) -> None:
        self._settings = settings
        self._delivery = BlockAssembler(calibration)
        self._clock = clock
        self._follower = RingFollower(
            len(calibration.channels),
            calibration.rate_hz,
            len(calibration.slow),
            begun_ns=clock.now_ns(),
        )
        self._fresh_at_s = 0.0
        self._stale_after_s = settings.stale_after_s
        self._slot_s = 0.0

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open the link and identify the device; leaving the context closes the link.

        Raises
        ------
        LinkError
            If the device does not answer, answers nonsense, or its data stand still.
        ConfigError
            If it is not a block ring, or not the configured one.
        """
        link = ModbusClient(self._settings)
        try:
            with _nonsense_drops_the_link():
                await link.open()
                reader = RingReader(link, self._settings.base_address, self._settings.function)
                await self._identify(reader)
            blocks = self._blocks(reader)
            try:
                yield blocks
            finally:
                await blocks.aclose()
        finally:
            link.close()

    async def _identify(self, reader: RingReader) -> None:
        header = await self._follower.header(reader)
        self._slot_s = header.layout.slot_duration_s
        self._stale_after_s = max(self._settings.stale_after_s, _MIN_STALE_SLOTS * self._slot_s)
        if self._follower.newest == (header.epoch, header.newest):
            self._require_fresh()
        else:
            self._fresh_at_s = self._clock.monotonic_s()

    async def _blocks(self, reader: RingReader) -> AsyncGenerator[SampleBlock, None]:
        period_s = incommensurate_period_s(self._settings.poll_period_s, self._slot_s)
        due_s = self._clock.monotonic_s()
        while True:
            begun_s = self._clock.monotonic_s()
            with _nonsense_drops_the_link():
                raw_blocks = await self._follower.advance(reader)
            arrived = Arrival.now(self._clock)
            n_waiting = self._follower.n_waiting
            read_for_s = arrived.steady_s - begun_s + n_waiting * self._slot_s
            for block in self._delivery.take_together(raw_blocks, arrived, read_for_s):
                yield block
            if raw_blocks:
                self._fresh_at_s = self._clock.monotonic_s()
                if n_waiting:
                    continue
            else:
                self._require_fresh()
            due_s = await self._wait(due_s + period_s)

    async def _wait(self, due_s: float) -> float:
        """Wait for the next poll; polls that are overdue are left out, never piled up."""
        now_s = self._clock.monotonic_s()
        due_s = max(due_s, now_s)
        await self._clock.sleep(due_s - now_s)
        return due_s

    def _require_fresh(self) -> None:
        standing_s = self._clock.monotonic_s() - self._fresh_at_s
        if standing_s > self._stale_after_s and self._follower.newest is not None:
            epoch, newest = self._follower.newest
            raise LinkError(
                f"{self._settings.transport}: the device answers but its data"
                f" stand still: no usable slot for {standing_s:.1f} s,"
                f" the newest is {newest} of epoch {epoch}"
            )


@contextmanager
def _nonsense_drops_the_link() -> Iterator[None]:
    """Turn a wrong reply into a lost link: on a stream, nothing after it can be trusted."""
    try:
        yield
    except FrameError as exc:
        raise LinkError(f"wrong reply, connection dropped: {exc}") from exc
