"""`UnitMemory`: what must be known of a unit, beside its newest samples, to go on elsewhere."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from core.alarms.board import AlarmMemory
from core.change.film_judge import FilmMemory
from core.monitor.monitor import MonitorState
from core.samples.gaps import Count

VERSION = 1


@dataclass(frozen=True)
class UnitMemory:
    """A unit between two blocks.

    Parameters
    ----------
    films
        Where they are watched.
    count
        That its blocks are in.
    version
        Of this form.
    """

    monitor: MonitorState
    alarms: AlarmMemory
    films: FilmMemory | None
    count: Count | None = None
    version: int = VERSION


NO_MEMORIES: Mapping[str, UnitMemory] = MappingProxyType({})
