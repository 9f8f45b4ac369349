"""`EvidenceDesk`: where the API asks for evidence; work is done in threads, a little at once."""

import asyncio
from collections.abc import AsyncIterator, Callable, Generator
from dataclasses import dataclass
from typing import TypeVar

from acquisition.clock import Clock
from service.reports.archive import EvidenceArchive, EvidenceState, Occurrence, SamplesState
from service.reports.bundle import bundle_files, zipped
from service.reports.configuration import Configuration
from service.reports.keeper import EvidenceKeeper
from service.reports.report.case import read_case
from service.reports.report.page import report_page

SLOTS = 2
"""Reports and pieces of bundles that are worked on at once."""

MAX_DOWNLOADS = 16
"""Bundles on their way at once; one that is read slowly takes a slot only for its next piece."""

T = TypeVar("T")


class TooManyDownloadsError(Exception):
    """No further bundle can be sent just now."""


@dataclass(frozen=True)
class Found:
    """An occurrence with what there is of its samples."""

    occurrence: Occurrence
    samples: SamplesState


class EvidenceDesk:
    """Lists evidence, prints reports, hands out bundles.

    Attributes
    ----------
    configuration
        What the plant is configured as now, without its secrets.
    """

    def __init__(
        self,
        archive: EvidenceArchive,
        keeper: EvidenceKeeper,
        trend_days: float,
        clock: Clock,
        configuration: Configuration,
    ) -> None:
        self.archive, self.keeper, self._clock = archive, keeper, clock
        self.configuration = configuration
        self._trend_days = trend_days
        self._slots = asyncio.Semaphore(SLOTS)
        self._n_downloads = 0

    async def occurrences(self, alarm: str, most: int) -> list[Found]:
        """The newest occurrences of an alarm, newest first."""
        pending, capturing = self.keeper.pending, self.keeper.capturing

        def look() -> list[Found]:
            found = self.archive.occurrences(alarm, pending, most)
            return [Found(each, self.archive.samples(each, capturing)) for each in found]

        return await self._worked(look)

    async def occurrence(self, alarm: str, number: int) -> Occurrence | None:
        """One of them; None if there never was such a one."""
        pending = self.keeper.pending
        return await self._worked(lambda: self.archive.occurrence(alarm, number, pending))

    async def report(self, found: Occurrence) -> str:
        """The page of an occurrence whose bundle is complete.

        Raises
        ------
        DamagedEvidenceError, LookupError
            If the bundle cannot be read, or is not there.
        """
        capturing = self.keeper.capturing
        return await self._worked(lambda: self._report(found, capturing))

    async def bundle(self, found: Occurrence, has_configuration: bool) -> AsyncIterator[bytes]:
        """A bundle as a ZIP file, piece by piece.

        Parameters
        ----------
        has_configuration
            Whether the settings of the whole plant are in it.

        Raises
        ------
        DamagedEvidenceError, LookupError, OSError
            If the bundle cannot be read, or is not there.
        TooManyDownloadsError
            If too many are on their way.
        """
        if self._n_downloads >= MAX_DOWNLOADS:
            raise TooManyDownloadsError(f"{MAX_DOWNLOADS} bundles are on their way")
        page = await self.report(found)
        files = await self._worked(
            lambda: bundle_files(self.archive, found, page, has_configuration)
        )
        return await self.download(zipped(files))

    async def download(self, pieces: Generator[bytes, None, None]) -> AsyncIterator[bytes]:
        """What is made piece by piece in threads, a little at once, as fast as it is taken.

        Raises
        ------
        TooManyDownloadsError
            If too many are on their way; and what making the first piece raises.
        """
        if self._n_downloads >= MAX_DOWNLOADS:
            raise TooManyDownloadsError(f"{MAX_DOWNLOADS} bundles are on their way")
        first = await self._worked(lambda: next(pieces, b""))  # now all files are open
        return self._sent(first, pieces)

    def _report(self, found: Occurrence, capturing: frozenset[tuple[str, int]]) -> str:
        samples = self.archive.samples(found, capturing)
        case = read_case(self.archive, found, samples, self._trend_days)
        return report_page(case, self._clock.now_ns())

    async def _sent(
        self, piece: bytes, pieces: Generator[bytes, None, None]
    ) -> AsyncIterator[bytes]:
        self._n_downloads += 1
        try:
            while piece:
                yield piece
                piece = await self._worked(lambda: next(pieces, b""))
        finally:
            self._n_downloads -= 1
            pieces.close()

    async def _worked(self, do: Callable[[], T]) -> T:
        async with self._slots:
            return await asyncio.to_thread(do)


def is_there(found: Occurrence) -> bool:
    """Whether there is a bundle."""
    return found.state is EvidenceState.COMPLETE
