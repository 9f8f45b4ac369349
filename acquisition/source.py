"""`SampleSource`: the port through which samples enter padwatch."""

from collections.abc import AsyncIterator, Mapping
from contextlib import AbstractAsyncContextManager
from typing import Protocol, runtime_checkable

from core.samples.blocks import SampleBlock


class SampleSource(Protocol):
    """Source of the samples of one unit.

    A source may be connected again after it was left; the sample index then shows what it missed.
    It neither retries nor logs: the runner does both, once for all sources.
    """

    def connect(self) -> AbstractAsyncContextManager[AsyncIterator[SampleBlock]]:
        """Open the link; leaving the context closes it.

        Raises
        ------
        LinkError
            If trying later is reasonable; raised on entering or while iterating.
        ConfigError
            If the device can never deliver what is configured.
        """
        ...


@runtime_checkable
class RefusesFrames(Protocol):
    """Source that counts the frames it refuses before they become samples."""

    @property
    def refused_frames(self) -> Mapping[str, int]:
        """Frames since the start that were not used, by reason."""
        ...


def refused_frames_of(source: SampleSource) -> Mapping[str, int]:
    """Refused frames of a source by reason; empty if it does not count them."""
    return source.refused_frames if isinstance(source, RefusesFrames) else {}
