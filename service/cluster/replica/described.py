"""`Described`: a unit as it is described, in a process that analyses none."""

from core.machine.unit import Unit


class Described:
    """Stands where there is no monitor: references change what is said of a unit."""

    def __init__(self, unit: Unit) -> None:
        self.unit = unit

    def replace_description(self, unit: Unit) -> None:
        """Take a new description of the same unit."""
        self.unit = unit
