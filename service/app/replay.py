"""Replay of recordings in place of a plant's sources."""

import threading
from collections.abc import AsyncGenerator, AsyncIterator, Iterable
from contextlib import AsyncExitStack, aclosing, asynccontextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from acquisition.errors import LinkError
from acquisition.source import SampleSource
from core.samples.blocks import SampleBlock
from core.units import NS_PER_S
from service.settings.plant import PlantFile
from service.settings.storage import StoreSettings

REPLAYS = "replays"
"""Folder below the plant's data folder, separate from its live database."""


def replayed_plant(plant: PlantFile, units: Iterable[str], folder: Path) -> PlantFile:
    """Return the replayed part of a plant: own folder, SQLite, reachable from this host only."""
    closed = {"host": "127.0.0.1", "socket": None, "tls": None}
    service = plant.service.model_copy(update={"data_folder": str(folder), **closed})
    chosen = tuple(unit for unit in plant.unit if unit.id in set(units))
    alone = {"unit": chosen, "service": service, "store": StoreSettings()}
    return plant.model_copy(update=alone)


def replay_folder(plant: PlantFile, recordings: Iterable[Path], now_ns: int) -> Path:
    """Return the folder of the results of one replay, named after recordings and time."""
    moment = datetime.fromtimestamp(now_ns // NS_PER_S, UTC).strftime("%Y%m%dT%H%M%SZ")
    name = "+".join(path.resolve().name for path in recordings)[:80]
    return Path(plant.service.data_folder) / REPLAYS / f"{name}-{moment}"


class PlayedOut:
    """A source behind a simulated DAQ that plays a recording: it ends when the recording has.

    The DAQ goes on answering after its recording has ended, as a device would whose converter has
    stopped. Its reader takes that for a lost link, which is what ends the stream here.

    Parameters
    ----------
    over
        Set when the DAQ has said that the recording is over.
    gone
        Set when there is no DAQ any more, which ends the stream, too; without it, it is waited for.
    """

    def __init__(
        self, source: SampleSource, over: threading.Event, gone: threading.Event | None = None
    ) -> None:
        self._source, self._over, self._gone = source, over, gone

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Open the link; see :class:`acquisition.source.SampleSource`.

        Raises
        ------
        LinkError, ConfigError
            As the source does, until the recording is over.
        """
        async with AsyncExitStack() as stack:
            try:
                blocks = await stack.enter_async_context(self._source.connect())
            except LinkError:
                if not self._is_over:
                    raise
                blocks = _nothing()
            yield await stack.enter_async_context(aclosing(self._until_over(blocks)))

    async def _until_over(
        self, blocks: AsyncIterator[SampleBlock]
    ) -> AsyncGenerator[SampleBlock, None]:
        try:
            async for block in blocks:
                yield replace(block, clock=None)  # the device stamped in the past, by no clock here
        except LinkError:
            if not self._is_over:
                raise

    @property
    def _is_over(self) -> bool:
        return self._over.is_set() or (self._gone is not None and self._gone.is_set())


async def _nothing() -> AsyncIterator[SampleBlock]:
    """A stream that has ended."""
    return
    yield
