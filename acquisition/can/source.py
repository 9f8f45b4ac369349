"""`CanSource`: sample source for a measuring device on a CAN bus."""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Mapping
from contextlib import aclosing, asynccontextmanager
from functools import partial

from acquisition.can.assembly import MAX_UNSURE_S, FrameAssembler
from acquisition.can.bus import open_bus
from acquisition.can.compiler import compile_plan
from acquisition.can.plan import SECONDS
from acquisition.can.reader import FrameReader
from acquisition.can.settings import CanSettings
from acquisition.clock import Clock
from acquisition.delivery.blocks import MIN_BLOCK_S, BlockAssembler
from acquisition.errors import LinkError
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration
from core.units import ns_from_s

_LOOK_S = 0.2

_PAUSE_S = 0.1
"""Time without new samples, s, after which samples held for a longer block are delivered."""

_MAX_DOUBT_S = 2 * MAX_UNSURE_S
"""Time, s, beyond `stale_after_s` within which the clock must confirm samples: two attempts."""

_MIN_STALE_INSTANTS = 3
"""Lower limit of the effective `CanSettings.stale_after_s`, in periods of sample instants."""


class CanSource:
    """Sample source of one unit from CAN frames; keeps its sample index across connections.

    Listen-only. CAN devices do not buffer samples: frames sent while the bus is closed are a gap.

    Raises
    ------
    ConfigError
        If DBC, settings and calibration do not match.
    """

    def __init__(self, settings: CanSettings, calibration: UnitCalibration, clock: Clock) -> None:
        self._settings = settings
        self._clock = clock
        self._plan = compile_plan(settings, calibration)
        instant_s = self._plan.samples_per_frame / calibration.rate_hz
        self._stale_after_s = max(settings.stale_after_s, _MIN_STALE_INSTANTS * instant_s)
        stamped = SECONDS in self._plan.quantities
        self._delivery = BlockAssembler(calibration, stamped=stamped, min_block_s=MIN_BLOCK_S)
        self._assembler = FrameAssembler(
            self._plan, clock.now_ns(), device_waits=settings.when_full == "wait"
        )
        self._silent_s = self._doubtful_s = 0.0

    @property
    def refused_frames(self) -> Mapping[str, int]:
        """Number of refused frames since the start of the source, by reason."""
        return {reason.value: n for reason, n in self._assembler.refused.items() if n}

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open the bus and yield sample blocks; close the bus on exit of the context.

        Raises
        ------
        LinkError
            If the bus is not available, bus-off or error-passive, or has no complete samples.
        ConfigError
            If the interface is not supported on this system.
        """
        settings, plan = self._settings, self._plan
        ids = [message.message.frame_id for message in plan.messages.values()]
        opened = partial(open_bus, settings.link, ids)
        reader = FrameReader(settings, opened, plan, self._assembler.refused, self._clock)
        self._assembler.listen()
        try:
            await reader.start()
            async with aclosing(self._blocks(reader)) as blocks:
                yield blocks
        finally:
            await reader.stop()

    async def _blocks(self, reader: FrameReader) -> AsyncGenerator[SampleBlock, None]:
        self._silent_s = self._doubtful_s = 0.0
        while True:
            try:
                blocks = await self._next_blocks(reader)
            except LinkError:
                for block in self._delivery.release():
                    yield block
                raise
            for block in blocks:
                yield block
            await asyncio.sleep(0)

    async def _next_blocks(self, reader: FrameReader) -> list[SampleBlock]:
        """Return the blocks that the next frames complete; held blocks too if no samples follow."""
        looked_s = self._clock.monotonic_s()
        look_s = _PAUSE_S if self._delivery.n_whole else _LOOK_S
        batch = await reader.next_batch(min(look_s, self._stale_after_s - self._silent_s))
        found: list[SampleBlock] = []
        blocks: list[SampleBlock] = []
        n_complete = self._assembler.n_complete
        if batch:
            if batch.stamp_fault:
                self._delivery.note_fault(batch.stamp_fault)
            arrived = batch.arrived
            steady_ns = ns_from_s(arrived.steady_s)
            found = self._assembler.take(batch.frames, arrived.host_ns, steady_ns)
            if self._assembler.trouble:
                found = []
                self._delivery.discard()  # from before it was noticed, so possibly of two devices
            blocks = self._delivery.take(found, arrived)
        # a suspended process was not listening; its suspension is no silence of the bus
        passed_s = min(self._clock.monotonic_s() - looked_s, 2 * _LOOK_S)
        has_come = self._assembler.n_complete > n_complete and not self._assembler.trouble
        self._silent_s = 0.0 if found or has_come else self._silent_s + passed_s
        self._doubtful_s = 0.0 if found else self._doubtful_s + passed_s
        self._require_fresh()
        if batch is None or self._doubtful_s > _PAUSE_S:
            blocks += self._delivery.release()
        return blocks

    def _require_fresh(self) -> None:
        """Raise LinkError for a bus without samples, or with samples that the clock contradicts."""
        is_doubtful = self._doubtful_s >= self._stale_after_s + _MAX_DOUBT_S
        if self._silent_s >= self._stale_after_s or is_doubtful:
            refused = ", ".join(f"{reason} {n}" for reason, n in self.refused_frames.items())
            trouble = self._assembler.trouble
            if is_doubtful and not trouble:
                trouble = "samples arrive more slowly than rate_hz;"
            raise LinkError(
                f"{self._settings.link}: no {'plausible' if trouble else 'complete'} sample for"
                f" {self._doubtful_s:.1f} s;{f' {trouble}' if trouble else ''}"
                f" frames refused so far: {refused or 'none'}"
            )
