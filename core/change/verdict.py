"""What is said of a film: the words, and the columns that hold them."""

from enum import IntEnum

from core.baseline.stiffness_history import Evidence
from core.limits import AlarmLevel


class Verdict(IntEnum):
    """What a reading says of the film; all but the first three say why it says nothing."""

    NORMAL = 0
    ALERT = 1
    DANGER = 2
    GATHERING_EVIDENCE = 3
    NO_BASELINE = 4
    INSUFFICIENT_EXCITATION = 5
    BAD_QUALITY = 6
    TRANSIENT = 7


JUDGED = (Verdict.NORMAL, Verdict.ALERT, Verdict.DANGER)
"""Verdicts that say something of the film."""

OF_EVIDENCE = {
    Evidence.INSUFFICIENT_EXCITATION: Verdict.INSUFFICIENT_EXCITATION,
    Evidence.BAD_QUALITY: Verdict.BAD_QUALITY,
}
"""Verdicts of readings without a number."""


def counted_verdict(level: AlarmLevel | None, is_enough: bool) -> Verdict:
    """Verdict of a reading that was compared with its baseline.

    Parameters
    ----------
    is_enough
        Whether there is enough evidence to call a film normal.
    """
    if level is not None:
        return Verdict(int(level))
    return Verdict.NORMAL if is_enough else Verdict.GATHERING_EVIDENCE
