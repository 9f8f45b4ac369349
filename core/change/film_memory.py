"""`FilmMemory`: what the watch of a unit's films remembers beside stored readings."""

from collections.abc import Mapping
from dataclasses import dataclass

from core.change.decision import Decision
from core.condition.oil_settling import OilSettling
from core.condition.operating_state import Operation


@dataclass(frozen=True)
class PlaceDecision:
    """What has been decided of a bearing in a direction, by the baseline of a version."""

    bearing: str
    direction: str
    version: int | None
    decision: Decision


@dataclass(frozen=True)
class FilmMemory:
    """The films of a unit at one moment.

    Parameters
    ----------
    oil
        By bearing.
    slot
        Number of the interval that had its reading last.
    """

    operation: Operation
    oil: Mapping[str, OilSettling]
    slot: int | None
    decided: tuple[PlaceDecision, ...]
