"""`PlantPart`: what of a plant a process looks after, where several share it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class PlantPart:
    """Some units, and perhaps what is done once for all of them.

    Parameters
    ----------
    own
        Its units, where they are not all.
    elsewhere
        Units that other processes look after.
    leads
        Whether it raises alarms about the service itself, and closes those of what is in the plant
        no more: one process does.
    """

    own: frozenset[str] = frozenset()
    elsewhere: frozenset[str] = frozenset()
    leads: bool = True

    def looks_after(self, unit: str) -> bool:
        """Whether a unit, or what is called so in its place, is this process's."""
        return unit in self.own or (self.leads and unit not in self.elsewhere)


WHOLE = PlantPart()
"""The only process of a plant."""
