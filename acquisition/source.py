"""The one port through which samples enter padwatch."""

from collections.abc import AsyncIterator, Mapping
from contextlib import AbstractAsyncContextManager
from typing import Protocol, runtime_checkable

from core.samples.blocks import SampleBlock


class SampleSource(Protocol):
    """Somewhere samples come from.

    A source may be connected again after it was left; it then reports what it missed through the
    sample index. It neither retries nor logs: the runner does both, once for all sources.
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
    """A source that counts what it heard and could not use, before there is a sample to count."""

    @property
    def refused_frames(self) -> Mapping[str, int]:
        """Frames since the start that were not used, by reason."""
        ...


def refused_frames_of(source: SampleSource) -> Mapping[str, int]:
    """What a source says of refused frames; nothing where it knows none."""
    return source.refused_frames if isinstance(source, RefusesFrames) else {}
