"""How the polls of a vector rack are averaged."""

from dataclasses import dataclass


@dataclass(frozen=True)
class VectorSettings:
    """Which polls make a result.

    Parameters
    ----------
    n_polls
        Polls in the averaging window; 60 of 5 s are five minutes.
    hop_polls
        Polls from one result to the next, after which limits of vibration are judged.
    min_polls
        Polls with a changed vector below which a result is uncertain; at least 2.
    """

    n_polls: int = 60
    hop_polls: int = 4
    min_polls: int = 4

    def __post_init__(self) -> None:
        if not 1 <= self.hop_polls <= self.n_polls:
            raise ValueError(
                f"a result comes every 1 to {self.n_polls} polls, got {self.hop_polls}"
            )
        if not 2 <= self.min_polls <= self.n_polls:
            raise ValueError(
                f"a window of {self.n_polls} has 2 polls or more, got {self.min_polls}"
            )
