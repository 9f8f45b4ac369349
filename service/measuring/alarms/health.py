"""`ServiceHealth`: how the service itself does, as far as alarms look at it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from core.limits import WITHIN, AlarmLevel, Judgement
from core.samples.gaps import SampleAccount

DiskJudge = Callable[[AlarmLevel | None], Judgement]
"""What is to be said of the fullest disk, by the level that it had before."""


def enough_room(held: AlarmLevel | None) -> Judgement:
    """Say so where nobody looks at the disks."""
    del held
    return WITHIN


@dataclass(frozen=True)
class ServiceHealth:
    """How the service does at one moment.

    Parameters
    ----------
    store_error
        Why the store refused what was written last; None if it did not.
    store_behind_s
        For how long something has been waiting for the store without anything being written.
    n_unstored
        Findings since the start that the store did not take: given up, or refused and parked.
    unstored_reason
        Why the newest of them is not stored.
    waiting_share
        How far the queue from acquisition to analysis is filled, 0 to 1.
    analysis_delay_s
        For how long the oldest block in it has waited, or how far behind its device the block from
        a stream was that was taken in last.
    captures_error
        Why samples around alarms are not kept; None if they are.
    recording_error
        Why not all samples are recorded that should be, or recordings are not looked after, so that
        there may soon be no room for more; None if all is well.
    n_recordings_damaged
        Recordings that were found damaged or missing since the start.
    refused
        Which questions are refused because the service is behind; None if none are.
    stored_trouble
        In what stored data are not what was stored; None as far as nothing is known to be wrong.
    stream_trouble
        Why blocks are not read from the stream just now; None if they are, or need not be.
    accounts
        Where samples went, by unit of which some have come since the start.
    disk
        Judges how full the disks are.
    """

    store_error: str | None = None
    store_behind_s: float = 0.0
    n_unstored: int = 0
    unstored_reason: str | None = None
    waiting_share: float = 0.0
    analysis_delay_s: float = 0.0
    captures_error: str | None = None
    recording_error: str | None = None
    n_recordings_damaged: int = 0
    refused: str | None = None
    stored_trouble: str | None = None
    stream_trouble: str | None = None
    accounts: Mapping[str, SampleAccount] = field(default_factory=dict)
    disk: DiskJudge = enough_room


@dataclass(frozen=True)
class StreamLook:
    """How blocks come over the stream, where they come that way.

    Parameters
    ----------
    trouble
        Why none come; None if they do.
    behind_s
        How far behind their devices those are that are taken in now.
    """

    trouble: Callable[[], str | None]
    behind_s: Callable[[], float]


LookAtHealth = Callable[[], ServiceHealth]
