"""How the evidence of alarms is kept."""

from dataclasses import dataclass


@dataclass(frozen=True)
class EvidenceStatus:
    """Bundles of evidence since the start.

    Parameters
    ----------
    error
        Why none is written just now; None if nothing hinders.
    """

    error: str | None
    n_waiting: int
    n_written: int
    n_lost: int
