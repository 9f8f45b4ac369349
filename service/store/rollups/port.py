"""What the program does with roll-ups: have them made."""

from collections.abc import Sequence
from typing import Protocol


class RollupStore(Protocol):
    """Trends gathered beforehand. What is not gathered yet is read reading by reading."""

    def due(self, now_ns: int) -> Sequence[int]:
        """Numbers of the bearings that have readings to gather."""
        ...

    def gather(self, series: int, now_ns: int) -> None:
        """Gather some readings of one bearing, all or nothing; no others are held up for long."""
        ...
