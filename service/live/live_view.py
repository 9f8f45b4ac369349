"""What is known now: the link to each unit, its newest samples and each bearing's assessment."""

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
"""How much of the newest samples is held of each unit."""

HELD_SAMPLES = 2_000_000
"""Of all channels of a unit together, at most."""


class LinkState(StrEnum):
    """Whether samples of a unit arrive."""

    CONNECTING = "connecting"
    CONNECTED = "connected"
    NOT_CONNECTED = "not_connected"
    ENDED = "ended"


@dataclass(frozen=True)
class UnitStatus:
    """How samples of a unit arrive.

    Parameters
    ----------
    reason
        Why it is not connected, in words.
    since_ns
        Since when it has been in this state.
    last_sample_ns
        Time of the newest sample by the device's clock.
    received_s
        When that arrived, on the steady clock.
    clock
        How the device's clock stands against the host's, where it can be told.
    stamp_fault
        Why the newest block's own time stamp was not used.
    n_failed
        How often connecting has failed, or a link was lost, since the service started.
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
    """A bearing as it may be shown now: without numbers when they are not current.

    Parameters
    ----------
    age_s
        Since the newest result; None if there has been none.
    """

    assessment: Assessment | None
    age_s: float | None
    quality: Quality
    readings: Mapping[str, Reading]
    is_current: bool


class LiveView:
    """The newest of everything; written by the runner, read by the API, on one event loop.

    Parameters
    ----------
    stale_after_s
        A result older than this is no longer current.
    """

    def __init__(self, units: Iterable[str], clock: Clock, stale_after_s: float) -> None:
        self._clock = clock
        self._stale_after_s = stale_after_s
        self._status = {unit: UnitStatus() for unit in units}
        self._assessments: dict[tuple[str, str], tuple[float, Assessment]] = {}
        self._blocks: dict[str, BlockHistory] = {}
        self.revision = 0
        """Another number as soon as a link has changed or a result has come."""

        self.store_error: str | None = None
        self.n_unstored = 0
        self.unstored_reason: str | None = None

    def note_unstored(self, n_findings: int, reason: str) -> None:
        """Count findings that are not in the database and never will be."""
        self.n_unstored += n_findings
        self.unstored_reason = reason

    def set_link(self, unit: str, state: LinkState, reason: str | None = None) -> bool:
        """Note the state of a link; return whether it changed."""
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
        """Note the arrival of a block whose samples were there then; just now if none is given."""
        self._hold(block)
        self._status[block.unit] = replace(
            self._status[block.unit],
            last_sample_ns=block.stop_ns,
            received_s=self._clock.monotonic_s() if sampled_s is None else sampled_s,
            account=account,
            clock=block.clock,
            stamp_fault=block.stamp_fault,
        )

    def set_assessment(self, assessment: Assessment, sampled_s: float | None = None) -> None:
        """Note a new result, of samples that were there then; just now if none is given."""
        self.revision += 1
        key = (assessment.unit, assessment.bearing)
        since_s = self._clock.monotonic_s() if sampled_s is None else sampled_s
        self._assessments[key] = (since_s, assessment)

    def status(self, unit: str) -> UnitStatus:
        """How samples of a unit arrive."""
        return self._status[unit]

    def blocks(self, unit: str) -> list[SampleBlock]:
        """The newest blocks of a unit, oldest first, current or not."""
        return list(self._blocks.get(unit, ()))

    def newest_block(self, unit: str) -> SampleBlock | None:
        """The newest block of a unit, current or not; None if there has been none."""
        blocks = self.blocks(unit)
        return blocks[-1] if blocks else None

    def why_no_samples(self, unit: str) -> Reason | None:
        """Why the newest samples of a unit are not current; None if they are."""
        return self._why_not_current(unit, self.data_age_s(unit))

    def data_age_s(self, unit: str) -> float | None:
        """Time since the newest block arrived; None if none has."""
        received_s = self._status[unit].received_s
        return None if received_s is None else self._clock.monotonic_s() - received_s

    def assessment(self, unit: str, bearing: str) -> Assessment | None:
        """The newest result, current or not."""
        entry = self._assessments.get((unit, bearing))
        return entry[1] if entry else None

    def current(self, unit: str, bearing: str) -> CurrentBearing:
        """The newest result as it may be shown: nothing old passes for current."""
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

    def _hold(self, block: SampleBlock) -> None:
        if block.unit not in self._blocks:
            most = HELD_SAMPLES // max(block.counts.shape[0], 1)
            self._blocks[block.unit] = BlockHistory(min(round(HELD_S * block.rate_hz), most))
        self._blocks[block.unit].add(block)
