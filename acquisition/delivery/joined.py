"""`JoinedSource`: waveforms of one device combined with slow values of another device."""

from collections.abc import AsyncGenerator, AsyncIterator, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import replace
from typing import Protocol

from acquisition.source import SampleSource, refused_frames_of
from core.quality import Reading
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration


class SlowValues(Protocol):
    """Device that is polled for slow values while another device sends waveforms."""

    def watch(self) -> AbstractAsyncContextManager[None]:
        """Poll the device until the context is left; a lost device raises no error.

        The first call waits on entering for the first reply or failure. Later calls do not wait,
        so that an unreachable device does not delay waveforms.
        """
        ...

    def current(self) -> Mapping[str, Reading]:
        """Return the newest reading of each slow channel; a stale reading has no value."""
        ...


class JoinedSource:
    """Source that adds the current slow values of a second device to each waveform block.

    If the slow device is lost or faulty, its values are missing with a reason, and the waveforms
    continue. The slow device is polled only while the waveform source is connected, so that retries
    of the waveform link do not reconnect it.
    """

    def __init__(self, source: SampleSource, slow: SlowValues) -> None:
        self._source, self._slow = source, slow

    @property
    def refused_frames(self) -> Mapping[str, int]:
        """Number of rejected frames of the waveform source, by reason."""
        return refused_frames_of(self._source)

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open both links; leaving the context closes them.

        Raises
        ------
        LinkError, ConfigError
            As raised by the waveform source.
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
    """Return the calibration of the slow-value device: only the slow channels `ids`."""
    slow = tuple(channel for channel in calibration.slow if channel.id in ids)
    return replace(calibration, channels=(), slow=slow)


def without_slow(calibration: UnitCalibration, ids: frozenset[str]) -> UnitCalibration:
    """Return the calibration of the waveform device, without the slow channels `ids`."""
    slow = tuple(channel for channel in calibration.slow if channel.id not in ids)
    return replace(calibration, slow=slow)
