"""Status of a unit's link, and newest result of a bearing with a check of its age."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from core.monitor.assessment import BearingResult
from core.monitor.catalogue import CATALOGUE
from core.quality import Quality, Reading, Reason, bad, missing
from core.samples.blocks import DeviceClock, StampFault
from core.samples.gaps import SampleAccount

HELD_S = 10.0
"""Duration of the newest samples held for each unit, in seconds."""

HELD_SAMPLES = 2_000_000
"""Maximum number of held samples over all channels of a unit."""


class LinkState(StrEnum):
    """State of the link to the device of a unit."""

    CONNECTING = "connecting"
    CONNECTED = "connected"
    NOT_CONNECTED = "not_connected"
    ENDED = "ended"


@dataclass(frozen=True)
class UnitStatus:
    """Status of the link to a unit's device, and of the samples received from it.

    Parameters
    ----------
    reason
        Reason why the device is not connected, or None.
    since_ns
        Start of the present link state, UTC nanoseconds since 1970.
    last_sample_ns
        End of the newest block by the time stamps of its samples, UTC nanoseconds since 1970; None
        before the first block.
    received_ns
        Arrival time of the newest block by the host clock of the serving process, UTC nanoseconds
        since 1970; None in the measuring process, and while the age of the block is unknown.
    account
        Counts of the samples that the device offered: stored, flagged, lost and rejected.
    clock
        Offset and drift of the device clock; None if unknown.
    stamp_fault
        Reason why the time stamp of the newest block was not used, or None.
    n_failed
        Number of failed connection attempts and lost links since the start.
    """

    state: LinkState = LinkState.CONNECTING
    reason: str | None = None
    since_ns: int | None = None
    last_sample_ns: int | None = None
    received_ns: int | None = None
    account: SampleAccount = field(default_factory=SampleAccount)
    clock: DeviceClock | None = None
    stamp_fault: StampFault | None = None
    n_failed: int = 0


@dataclass(frozen=True)
class StoredResults:
    """Results of a unit in the database.

    `n_writes` is the number of transactions with results or gaps of the unit since the start;
    `newest_ns` is the time of the newest stored result, UTC nanoseconds since 1970, 0 before the
    first.
    """

    n_writes: int = 0
    newest_ns: int = 0


@dataclass(frozen=True)
class CurrentBearing:
    """Newest result of a bearing; if it is not current, all readings are missing.

    Parameters
    ----------
    assessment
        Newest result, current or not; None before the first result.
    age_s
        Age of the newest result in seconds; None before the first result.
    received_ns
        Arrival time of the samples of the newest result by the clock of the serving host, ns since
        1970 UTC; None if unknown.
    """

    assessment: BearingResult | None
    age_s: float | None
    received_ns: int | None
    quality: Quality
    readings: Mapping[str, Reading]
    is_current: bool


def why_not_current(state: LinkState, age_s: float | None, stale_after_s: float) -> Reason | None:
    """Return the reason why data of a unit are not current; None if they are current.

    `age_s` is the age of the newest data, s, None before the first; data older than `stale_after_s`
    are not current.
    """
    if state not in (LinkState.CONNECTED, LinkState.ENDED):
        return Reason.NOT_CONNECTED
    if age_s is None:
        return Reason.WAITING_FOR_DATA
    if state is LinkState.ENDED:  # the last result of a recording remains its result
        return None
    return Reason.STALE if age_s > stale_after_s else None


def current_bearing(
    assessment: BearingResult | None,
    age_s: float | None,
    why_not: Reason | None,
    received_ns: int | None = None,
) -> CurrentBearing:
    """Return the newest result of a bearing, without readings if there is a reason `why_not`.

    `age_s` is the age of the result, s; `received_ns` is the arrival time of its samples by the
    clock of the serving host, ns since 1970 UTC. Unknown values are None.
    """
    if assessment is None or why_not is not None:
        nothing = missing(why_not or Reason.WAITING_FOR_DATA)
        readings = {quantity.name: nothing for quantity in CATALOGUE}
        quality = bad(nothing.quality.reason)
        return CurrentBearing(assessment, age_s, received_ns, quality, readings, is_current=False)
    newest = (assessment.quality, assessment.readings)
    return CurrentBearing(assessment, age_s, received_ns, *newest, is_current=True)
