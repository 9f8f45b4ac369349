"""Which units a process analyses, of several processes that share a plant."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from service.measuring.alarm_engine import PlantPart
from service.settings.plant import PlantFile

FORM = re.compile(r"([0-9]{1,4})/([0-9]{1,4})")


@dataclass(frozen=True)
class Partition:
    """The ``number``-th of ``n_parts``, counted from 1."""

    number: int = 1
    n_parts: int = 1

    @classmethod
    def of(cls, text: str) -> "Partition":
        """Read it from ``i/n``. Raises `ValueError` if it is none."""
        found = FORM.fullmatch(text)
        part = cls(int(found[1]), int(found[2])) if found else cls(0, 0)
        if not 1 <= part.number <= part.n_parts:
            raise ValueError(
                f"{text!r} is no partition: give i/n with i from 1 to n, such as 1/2 and 2/2"
            )
        return part

    def units(self, units: Sequence[str]) -> list[str]:
        """Those that it analyses: every n-th of the sorted ids, so that all have about as many."""
        return sorted(units)[self.number - 1 :: self.n_parts]

    def part_of(self, plant: PlantFile) -> PlantFile:
        """The plant as far as it is analysed here.

        Raises
        ------
        ValueError
            If that is no unit at all.
        """
        mine = set(self.units([unit.id for unit in plant.unit]))
        if not mine:
            raise ValueError(
                f"partition {self.number}/{self.n_parts} of {len(plant.unit)} units is empty: give"
                f" no more than {len(plant.unit)} parts"
            )
        return plant.model_copy(update={"unit": tuple(u for u in plant.unit if u.id in mine)})

    def share_of(self, plant: PlantFile) -> PlantPart:
        """What this process looks after of a whole plant."""
        every = [unit.id for unit in plant.unit]
        own = frozenset(self.units(every))
        return PlantPart(own, frozenset(every) - own, leads=self.number == 1)
