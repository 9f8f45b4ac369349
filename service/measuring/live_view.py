"""`LiveView`: newest link state and samples of each unit, newest assessment of each bearing."""

from collections.abc import Iterable
from dataclasses import replace

from acquisition.clock import Clock
from core.monitor.assessment import Assessment
from core.samples.blocks import SampleBlock
from core.samples.gaps import SampleAccount
from service.live.samples import BlockHistory
from service.live.snapshot import UnitLink
from service.live.status import (
    HELD_S,
    HELD_SAMPLES,
    CurrentBearing,
    LinkState,
    StoredResults,
    UnitStatus,
    current_bearing,
    why_not_current,
)
from service.store.port import UnitGap


class LiveView:
    """Newest link state, samples and results of all units, as the analysis found them.

    `stale_after_s` is the age above which a result is no longer current, s.
    """

    def __init__(self, units: Iterable[str], clock: Clock, stale_after_s: float) -> None:
        self._clock = clock
        self._stale_after_s = stale_after_s
        self._status = {unit: UnitStatus() for unit in units}
        self._results: dict[str, dict[str, tuple[float, Assessment]]] = {
            u: {} for u in self._status
        }
        self._blocks: dict[str, BlockHistory] = {}
        self._received_s: dict[str, float] = {}
        self._stored = dict.fromkeys(self._status, StoredResults())

        self.store_error: str | None = None
        self.n_unstored = 0
        self.unstored_reason: str | None = None

    def note_stored(self, assessments: Iterable[Assessment], gaps: Iterable[UnitGap] = ()) -> None:
        """Record that the results and gaps of one transaction are now in the database."""
        newest_ns = {gap.unit: 0 for gap in gaps} | {a.unit: a.time_ns for a in assessments}
        for unit, time_ns in newest_ns.items():
            before = self._stored[unit]
            self._stored[unit] = StoredResults(before.n_writes + 1, max(before.newest_ns, time_ns))

    def note_unstored(self, n_findings: int, reason: str) -> None:
        """Count findings that were lost because they could not be stored; keep the reason."""
        self.n_unstored += n_findings
        self.unstored_reason = reason

    def set_link(self, unit: str, state: LinkState, reason: str | None = None) -> bool:
        """Set the state and reason of a unit's link; return whether the state changed."""
        before = self._status[unit]
        self._status[unit] = replace(
            before,
            state=state,
            reason=reason,
            since_ns=before.since_ns if before.state is state else self._clock.now_ns(),
            n_failed=before.n_failed + (state is LinkState.NOT_CONNECTED),
        )
        return before.state is not state

    def set_received(
        self, block: SampleBlock, account: SampleAccount, sampled_s: float | None = None
    ) -> None:
        """Set a unit's newest block; ``sampled_s`` is its monotonic time, by default now."""
        if block.unit not in self._blocks:
            most = HELD_SAMPLES // max(block.counts.shape[0], 1)
            self._blocks[block.unit] = BlockHistory(min(round(HELD_S * block.rate_hz), most))
        self._blocks[block.unit].add(block)
        self._received_s[block.unit] = self._clock.monotonic_s() if sampled_s is None else sampled_s
        self._status[block.unit] = replace(
            self._status[block.unit],
            last_sample_ns=block.stop_ns,
            account=account,
            clock=block.clock,
            stamp_fault=block.stamp_fault,
        )

    def set_assessment(self, assessment: Assessment, sampled_s: float | None = None) -> None:
        """Set a bearing's newest result; ``sampled_s`` is its monotonic time, by default now."""
        since_s = self._clock.monotonic_s() if sampled_s is None else sampled_s
        self._results[assessment.unit][assessment.bearing] = (since_s, assessment)

    def status(self, unit: str) -> UnitStatus:
        """Return the status of the link and the samples of a unit."""
        return self._status[unit]

    def blocks(self, unit: str) -> list[SampleBlock]:
        """Return the newest blocks of a unit, oldest first; they may be out of date."""
        return list(self._blocks.get(unit, ()))

    def data_age_s(self, unit: str) -> float | None:
        """Return the age of the newest block in seconds; None before the first block."""
        received_s = self._received_s.get(unit)
        return None if received_s is None else self._clock.monotonic_s() - received_s

    def assessment(self, unit: str, bearing: str) -> Assessment | None:
        """Return the newest result of a bearing, possibly out of date; None before the first."""
        entry = self._results.get(unit, {}).get(bearing)
        return entry[1] if entry else None

    def link(self, unit: str) -> UnitLink:
        """Return the link of a unit with the ages of its data; without data for other names."""
        now_s, results = self._clock.monotonic_s(), self._results.get(unit, {})
        return UnitLink(
            self._status.get(unit, UnitStatus()),
            self.data_age_s(unit),
            {bearing: now_s - since_s for bearing, (since_s, _) in results.items()},
            now_s,
            self.store_error,
            self._stored.get(unit, StoredResults()),
        )

    def current(self, unit: str, bearing: str) -> CurrentBearing:
        """Return the newest result of a bearing; all readings are missing if it is out of date."""
        link = self.link(unit)
        age_s = link.result_ages_s.get(bearing)
        why_not = why_not_current(link.status.state, age_s, self._stale_after_s)
        return current_bearing(self.assessment(unit, bearing), age_s, why_not)
