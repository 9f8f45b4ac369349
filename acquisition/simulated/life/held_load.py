"""`HeldLoad`: a unit that is kept running, come what may, as for a demonstration."""

from dataclasses import dataclass


@dataclass(frozen=True)
class HeldLoad:
    """From a moment on a unit runs without a stop, at one load.

    Parameters
    ----------
    from_ns
        What was before stays as it is.
    load
        Share of rated power.

    Raises
    ------
    ValueError
        If the load does not lie between 0 and 1.
    """

    from_ns: int
    load: float

    def __post_init__(self) -> None:
        if not 0.0 < self.load <= 1.0:
            raise ValueError(f"load = {self.load:g} must lie above 0 and up to 1")
