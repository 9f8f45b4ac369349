"""`Strain`: by how much the service is behind, and which questions are not answered then."""

from dataclasses import dataclass, replace
from enum import IntEnum

RELIEF_SHARE = 0.5
"""Of what it began at: below that, and for some time, the strain is over."""

RELIEF_S = 5.0


class Refused(IntEnum):
    """Which questions are refused; a higher number refuses those of the lower ones too."""

    NOTHING = 0
    HISTORY = 1
    VIEWS = 2


@dataclass(frozen=True)
class LoadLimits:
    """From when on questions about the past are refused; at twice as much, views of now are too.

    In between, waveforms are no longer recorded (`service.recordings.continuous.pressure`).

    Parameters
    ----------
    delay_s
        For how long the oldest block has waited for its analysis.
    waiting_share
        How far the queue to the analysis is filled, 0 to 1.
    lag_s
        By how much the event loop is late, and stays so.
    """

    delay_s: float = 2.0
    waiting_share: float = 0.2
    lag_s: float = 1.0


@dataclass(frozen=True)
class Load:
    """How busy the service is at one moment; as `LoadLimits`."""

    delay_s: float = 0.0
    waiting_share: float = 0.0
    lag_s: float = 0.0

    def over(self, limits: LoadLimits) -> float:
        """What is worst, in terms of its limit."""
        return max(
            self.delay_s / limits.delay_s,
            self.waiting_share / limits.waiting_share,
            self.lag_s / limits.lag_s,
        )


@dataclass(frozen=True)
class Strain:
    """What is refused now.

    Parameters
    ----------
    relieved_s
        Since when less would do, steady time; None if it would not.
    """

    refused: Refused = Refused.NOTHING
    relieved_s: float | None = None


def advance(strain: Strain, over: float, now_s: float) -> Strain:
    """Take in how busy the service is: refuse more at once, and less only after a while."""
    wanted = Refused(min(int(over), Refused.VIEWS))
    if wanted >= strain.refused or over > RELIEF_SHARE * strain.refused:
        return Strain(max(wanted, strain.refused))
    if strain.relieved_s is None:
        return replace(strain, relieved_s=now_s)
    is_over = now_s - strain.relieved_s >= RELIEF_S
    return Strain(Refused(strain.refused - 1)) if is_over else strain
