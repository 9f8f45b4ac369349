"""A range of values that a query asks for."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ValueRange:
    """Bounds, both included; None leaves a side open."""

    low: float | None = None
    high: float | None = None
