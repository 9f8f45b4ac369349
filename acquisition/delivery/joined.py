"""`JoinedSource`: waveforms from one device, slow values from another."""

from collections.abc import AsyncGenerator, AsyncIterator, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import replace
from typing import Protocol

from acquisition.source import SampleSource, refused_frames_of
from core.quality import Reading
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration


class SlowValues(Protocol):
    """A device that is asked for slow values while another one sends waveforms."""

    def watch(self) -> AbstractAsyncContextManager[None]:
        """Ask it again and again until the context is left; losing it ends nothing.

        The first time, entering waits for its first answer, or until it is known that there is
        none; later it does not, for a device that is away must not hold up waveforms.
        """
        ...

    def current(self) -> Mapping[str, Reading]:
        """The newest value of each slow channel that it measures; a reason where it is too old."""
        ...


class JoinedSource:
    """Puts the current slow values onto each block of another source.

    A slow device that is lost, or faulty, is no reason to lose waveforms: its values are then
    missing, with the reason. It is read only while waveforms come, so that attempts to
    reach the other device do not connect to it each time.
    """

    def __init__(self, source: SampleSource, slow: SlowValues) -> None:
        self._source, self._slow = source, slow

    @property
    def refused_frames(self) -> Mapping[str, int]:
        """Frames that the source of the waveforms has not used, by reason."""
        return refused_frames_of(self._source)

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open both links; leaving the context closes them.

        Raises
        ------
        LinkError, ConfigError
            As the source of the waveforms does.
        """
        async with self._source.connect() as blocks, self._slow.watch():
            joined = self._joined(blocks)
            try:
                yield joined
            finally:
                await joined.aclose()

    async def _joined(
        self, blocks: AsyncIterator[SampleBlock]
    ) -> AsyncGenerator[SampleBlock, None]:
        async for block in blocks:
            yield replace(block, elsewhere={**block.elsewhere, **self._slow.current()})


def only_slow(calibration: UnitCalibration, ids: frozenset[str]) -> UnitCalibration:
    """Calibration of the slow channels that another device measures, without waveforms."""
    slow = tuple(channel for channel in calibration.slow if channel.id in ids)
    return replace(calibration, channels=(), slow=slow)


def without_slow(calibration: UnitCalibration, ids: frozenset[str]) -> UnitCalibration:
    """Calibration of the device that sends the waveforms, and what it measures itself."""
    slow = tuple(channel for channel in calibration.slow if channel.id not in ids)
    return replace(calibration, slow=slow)
