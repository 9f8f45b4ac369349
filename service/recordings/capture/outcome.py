"""`Outcome`: what has become of a capture, for whoever wants to refer to it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from core.alarms.alarm import AlarmEvent


@dataclass(frozen=True)
class Outcome:
    """What has become of a capture.

    Parameters
    ----------
    folder
        Where it is; None if it could not be written.
    reason
        Why not.
    """

    alarms: Sequence[AlarmEvent]
    folder: Path | None
    reason: str | None = None


def unheeded(_: Outcome) -> None:
    """Nobody wants to know."""
