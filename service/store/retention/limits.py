"""`RetentionLimits`: for how long what is kept how finely."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RetentionLimits:
    """Ages beyond which something is deleted, ns; None for what is kept for ever.

    Parameters
    ----------
    readings_ns
        Single readings of bearings.
    minutes_ns, ten_minutes_ns
        Roll-ups of that width; what is finer must not be kept longer.
    films_ns
        Readings of films, with what was said of them.
    letters_ns
        Messages to receivers, once they were delivered or given up.
    """

    readings_ns: int | None = None
    minutes_ns: int | None = None
    ten_minutes_ns: int | None = None
    films_ns: int | None = None
    letters_ns: int | None = None

    @property
    def tiers(self) -> tuple[tuple[int, int | None], ...]:
        """Width and age of each tier, finest first."""
        return ((0, self.readings_ns), (60, self.minutes_ns), (600, self.ten_minutes_ns))
