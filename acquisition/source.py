"""`SampleSource`: interface of all sources of samples."""

from collections.abc import AsyncIterator, Mapping
from contextlib import AbstractAsyncContextManager
from typing import Protocol

from core.samples.blocks import SampleBlock


class SampleSource(Protocol):
    """Source of the samples of one unit.

    A source may be connected again after its context was left; the sample index then shows the
    gap. A source does not retry and does not log; its caller does both for all sources.
    """

    def connect(self) -> AbstractAsyncContextManager[AsyncIterator[SampleBlock]]:
        """Open the link and iterate over sample blocks; leaving the context closes the link.

        Raises
        ------
        LinkError
            If a later attempt may succeed; raised on entering or while iterating.
        ConfigError
            If the device cannot deliver the configured channels.
        """
        ...


def refused_frames_of(source: SampleSource) -> Mapping[str, int]:
    """Return the numbers of rejected frames of a source by reason; empty if it has no counters."""
    counts: Mapping[str, int] = getattr(source, "refused_frames", {})
    return counts
