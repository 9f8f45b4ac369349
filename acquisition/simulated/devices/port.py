"""What all servers of the simulated DAQ have in common."""

from collections.abc import Mapping
from types import TracebackType
from typing import Protocol, Self


class DaqServer(Protocol):
    """One simulated device on one real link: entered to be plugged in, left to be pulled out."""

    @property
    def endpoint(self) -> Mapping[str, str | int]:
        """Where a reader finds it: keys and values of the source's settings; known once entered."""
        ...

    async def run(self) -> None:
        """Serve until cancelled; return when the device's feed has ended."""
        ...

    def inject(self, fault: str, count: int = 1) -> None:
        """Let the device do something wrong so many times.

        Raises
        ------
        LookupError
            If it does not know this fault; the message lists those it knows.
        """
        ...

    async def __aenter__(self) -> Self:
        """Begin to listen."""
        ...

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop."""
        ...
