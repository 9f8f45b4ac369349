"""`LiveView`: newest link state and samples of each unit, newest assessment of each bearing."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from acquisition.clock import Clock
from core.monitor.assessment import Assessment
from core.monitor.catalogue import CATALOGUE
from core.quality import Quality, Reading, Reason, bad, missing
from core.samples.blocks import DeviceClock, SampleBlock, StampFault
from core.samples.gaps import SampleAccount
from service.live.samples import BlockHistory

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
        End of the newest block by the time stamps of its samples, UTC nanoseconds since 1970.
    received_s
        Arrival time of the newest block by a monotonic clock, s; None before the first block.
    account
        Balance of the samples that the device offered.
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
    received_s: float | None = None
    account: SampleAccount = field(default_factory=SampleAccount)
    clock: DeviceClock | None = None
    stamp_fault: StampFault | None = None
    n_failed: int = 0


@dataclass(frozen=True)
class CurrentBearing:
    """Newest result of a bearing; if it is not current, all readings are missing.

    Parameters
    ----------
    assessment
        Newest result, current or not; None before the first result.
    age_s
        Age of the newest result in seconds; None before the first result.
    """

    assessment: Assessment | None
    age_s: float | None
    quality: Quality
    readings: Mapping[str, Reading]
    is_current: bool


class LiveView:
    """Newest state of all units, written by the analysis and read by the API in one event loop.

    Parameters
    ----------
    stale_after_s
        Age above which a result is no longer current.
    """

    def __init__(self, units: Iterable[str], clock: Clock, stale_after_s: float) -> None:
        self._clock = clock
        self._stale_after_s = stale_after_s
        self._status = {unit: UnitStatus() for unit in units}
        self._assessments: dict[tuple[str, str], tuple[float, Assessment]] = {}
        self._blocks: dict[str, BlockHistory] = {}
        self.revision = 0
        """Counter that increases with every change of a link state and every result."""

        self.store_error: str | None = None
        self.n_unstored = 0
        self.unstored_reason: str | None = None

    def note_unstored(self, n_findings: int, reason: str) -> None:
        """Add to the number of findings lost because they could not be stored; keep the reason."""
        self.n_unstored += n_findings
        self.unstored_reason = reason

    def set_link(self, unit: str, state: LinkState, reason: str | None = None) -> bool:
        """Set the state of a unit's link and its reason; return whether the state changed."""
        before = self._status[unit]
        if state is LinkState.NOT_CONNECTED:
            before = self._status[unit] = replace(before, n_failed=before.n_failed + 1)
        if (before.state, before.reason) == (state, reason):
            return False
        self.revision += 1
        since_ns = before.since_ns if before.state is state else self._clock.now_ns()
        self._status[unit] = replace(before, state=state, reason=reason, since_ns=since_ns)
        return before.state is not state

    def set_received(
        self, block: SampleBlock, account: SampleAccount, sampled_s: float | None = None
    ) -> None:
        """Set the newest block of a unit; ``sampled_s`` is its monotonic arrival time, else now."""
        if block.unit not in self._blocks:
            most = HELD_SAMPLES // max(block.counts.shape[0], 1)
            self._blocks[block.unit] = BlockHistory(min(round(HELD_S * block.rate_hz), most))
        self._blocks[block.unit].add(block)
        self._status[block.unit] = replace(
            self._status[block.unit],
            last_sample_ns=block.stop_ns,
            received_s=self._clock.monotonic_s() if sampled_s is None else sampled_s,
            account=account,
            clock=block.clock,
            stamp_fault=block.stamp_fault,
        )

    def set_assessment(self, assessment: Assessment, sampled_s: float | None = None) -> None:
        """Set the newest result; ``sampled_s`` is its samples' monotonic arrival time, else now."""
        self.revision += 1
        key = (assessment.unit, assessment.bearing)
        since_s = self._clock.monotonic_s() if sampled_s is None else sampled_s
        self._assessments[key] = (since_s, assessment)

    def status(self, unit: str) -> UnitStatus:
        """Return the status of the link and the samples of a unit."""
        return self._status[unit]

    def blocks(self, unit: str) -> list[SampleBlock]:
        """Return the held blocks of a unit, oldest first; they may be out of date."""
        return list(self._blocks.get(unit, ()))

    def newest_block(self, unit: str) -> SampleBlock | None:
        """Return the newest block of a unit, possibly out of date; None before the first block."""
        blocks = self.blocks(unit)
        return blocks[-1] if blocks else None

    def why_no_samples(self, unit: str) -> Reason | None:
        """Return the reason why a unit's samples are out of date; None if they are current."""
        return self._why_not_current(unit, self.data_age_s(unit))

    def data_age_s(self, unit: str) -> float | None:
        """Return the age of the newest block in seconds; None before the first block."""
        received_s = self._status[unit].received_s
        return None if received_s is None else self._clock.monotonic_s() - received_s

    def assessment(self, unit: str, bearing: str) -> Assessment | None:
        """Return the newest result of a bearing, possibly out of date; None before the first."""
        entry = self._assessments.get((unit, bearing))
        return entry[1] if entry else None

    def current(self, unit: str, bearing: str) -> CurrentBearing:
        """Return the newest result of a bearing; all readings are missing if it is out of date."""
        entry = self._assessments.get((unit, bearing))
        age_s = None if entry is None else self._clock.monotonic_s() - entry[0]
        reason = self._why_not_current(unit, age_s)
        if entry is None or reason is not None:
            nothing = missing(reason or Reason.WAITING_FOR_DATA)
            return CurrentBearing(
                assessment=entry[1] if entry else None,
                age_s=age_s,
                quality=bad(nothing.quality.reason),
                readings={quantity.name: nothing for quantity in CATALOGUE},
                is_current=False,
            )
        return CurrentBearing(entry[1], age_s, entry[1].quality, entry[1].readings, is_current=True)

    def _why_not_current(self, unit: str, age_s: float | None) -> Reason | None:
        if self._status[unit].state is not LinkState.CONNECTED:
            return Reason.NOT_CONNECTED
        if age_s is None:
            return Reason.WAITING_FOR_DATA
        return Reason.STALE if age_s > self._stale_after_s else None
