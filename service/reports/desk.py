"""`EvidenceDesk`: where the API asks for evidence; work is done in threads, a little at once."""

from collections.abc import AsyncIterator
from dataclasses import dataclass

from acquisition.clock import Clock
from service.api.downloads import Downloads
from service.reports.archive import EvidenceArchive, EvidenceState, Occurrence, SamplesState
from service.reports.bundle import bundle_files
from service.reports.keeper import EvidenceKeeper
from service.reports.report.case import read_case
from service.reports.report.page import report_page
from service.runtime.files import zipped


@dataclass(frozen=True)
class Found:
    """An occurrence with what there is of its samples."""

    occurrence: Occurrence
    samples: SamplesState


class EvidenceDesk:
    """Lists evidence, prints reports, hands out bundles."""

    def __init__(
        self,
        archive: EvidenceArchive,
        keeper: EvidenceKeeper,
        trend_days: float,
        clock: Clock,
        downloads: Downloads,
    ) -> None:
        self.archive, self.keeper, self._clock = archive, keeper, clock
        self._downloads = downloads
        self._trend_days = trend_days

    async def occurrences(self, alarm: str, most: int) -> list[Found]:
        """The newest occurrences of an alarm, newest first."""
        pending, capturing = self.keeper.pending, self.keeper.capturing

        def look() -> list[Found]:
            found = self.archive.occurrences(alarm, pending, most)
            return [Found(each, self.archive.samples(each, capturing)) for each in found]

        return await self._downloads.worked(look)

    async def occurrence(self, alarm: str, number: int) -> Occurrence | None:
        """One of them; None if there never was such a one."""
        pending = self.keeper.pending
        return await self._downloads.worked(lambda: self.archive.occurrence(alarm, number, pending))

    async def report(self, found: Occurrence) -> str:
        """The page of an occurrence whose bundle is complete.

        Raises
        ------
        DamagedEvidenceError, LookupError
            If the bundle cannot be read, or is not there.
        """
        capturing = self.keeper.capturing
        return await self._downloads.worked(lambda: self._report(found, capturing))

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
        self._downloads.require_room()
        page = await self.report(found)
        files = await self._downloads.worked(
            lambda: bundle_files(self.archive, found, page, has_configuration)
        )
        return await self._downloads.download(zipped(files))

    def _report(self, found: Occurrence, capturing: frozenset[tuple[str, int]]) -> str:
        samples = self.archive.samples(found, capturing)
        case = read_case(self.archive, found, samples, self._trend_days)
        return report_page(case, self._clock.now_ns())


def is_there(found: Occurrence) -> bool:
    """Whether there is a bundle."""
    return found.state is EvidenceState.COMPLETE
