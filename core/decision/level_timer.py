"""On- and off-delay of a level in running hours, with an optional latch."""

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class LevelTimer:
    """Whether a level counts, and for how many readings in a row something spoke for or against.

    Only readings that were judged are counted: nothing that is unknown speaks for or against.
    """

    is_active: bool = False
    n_passed: int = 0
    n_below: int = 0

    def step(
        self, is_passed: bool, is_held: bool, n_on: int, n_off: int, is_latching: bool
    ) -> "LevelTimer":
        """Take in one judged reading.

        Parameters
        ----------
        is_passed, is_held
            Whether the limit is passed, and whether it still is with its deadband.
        n_on, n_off
            Readings in a row that switch the level on, or off.
        """
        n_passed = self.n_passed + 1 if is_passed else 0
        n_below = 0 if is_held else self.n_below + 1
        is_active = self.is_active
        if n_passed >= n_on:
            is_active = True
        elif n_below >= n_off and not is_latching:
            is_active = False
        return LevelTimer(is_active, n_passed, n_below)

    def released(self, n_off: int) -> "LevelTimer":
        """Without its latch, if nothing has held it for the off-delay."""
        return replace(self, is_active=False) if self.n_below >= n_off else self


REST = LevelTimer()
