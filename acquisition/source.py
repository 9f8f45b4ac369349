"""The one port through which samples enter padwatch."""

from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager
from typing import Protocol

from core.blocks import SampleBlock


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
