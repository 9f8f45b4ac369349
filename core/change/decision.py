"""Whether a film has changed: one decision, led on reading by reading."""

import math
from dataclasses import dataclass, replace

import numpy as np

from core.baseline.baseline import QuantityBaseline
from core.change.evidence import NOTHING_GATHERED, Counted, Finding, GatheredEvidence
from core.change.reading import WatchedReading
from core.change.settings import ALERT_MARGIN, DANGER_MARGIN, ChangeLimits, sure_size
from core.change.verdict import OF_EVIDENCE, Verdict, counted_verdict
from core.condition.cells import FilmConditions
from core.limits import REST, AlarmLevel, LevelTimer
from core.units import NS_PER_S


@dataclass(frozen=True)
class Decision:
    """What is known of one quantity in one direction.

    Parameters
    ----------
    verdict
        What the newest reading says.
    finding
        The most significant mean deviation, as of the newest reading that counted.
    deviation, deviation_std
        Of the newest reading that counted, single: ln over the baseline, and what it may stray by.
    alert, danger
        Levels with their delays.
    last_ns, last_counted_ns
        Newest reading, and newest that counted.
    """

    verdict: Verdict = Verdict.GATHERING_EVIDENCE
    finding: Finding | None = None
    deviation: float | None = None
    deviation_std: float | None = None
    evidence: GatheredEvidence = NOTHING_GATHERED
    alert: LevelTimer = REST
    danger: LevelTimer = REST
    last_ns: int | None = None
    last_counted_ns: int | None = None

    @property
    def level(self) -> AlarmLevel | None:
        """Level that is held, whether or not the newest reading could be judged."""
        if self.danger.is_active:
            return AlarmLevel.DANGER
        return AlarmLevel.ALERT if self.alert.is_active else None


UNDECIDED = Decision()
"""Where a film begins, and begins again with another baseline."""


def advance(
    decision: Decision,
    reading: WatchedReading,
    baseline: QuantityBaseline | None,
    limits: ChangeLimits,
) -> Decision:
    """Take in one reading.

    Readings that come sooner after the last one that counted than half of what a reading stands for
    are not counted: they are much the same samples.

    Raises
    ------
    ValueError
        If the reading is not later than the one before.
    """
    if decision.last_ns is not None and reading.time_ns <= decision.last_ns:
        raise ValueError(f"reading at {reading.time_ns} ns is not after {decision.last_ns} ns")
    decision = replace(decision, last_ns=reading.time_ns)
    unusable = _unusable(reading)
    if unusable is not None:
        return replace(decision, verdict=unusable)
    if baseline is None:
        return replace(decision, verdict=Verdict.NO_BASELINE)
    condition = FilmConditions.one(
        reading.eccentricity_ratio, reading.oil_temperature_c, reading.attitude_deg
    )
    if not baseline.is_known(condition)[0]:
        return replace(decision, verdict=Verdict.BAD_QUALITY)
    return _compared(decision, reading, condition, baseline, limits)


def release(decision: Decision, baseline: QuantityBaseline, limits: ChangeLimits) -> Decision:
    """Release latches whose condition has gone for the off-delay."""
    n_off = readings_of(limits.off_delay_h, baseline.reading_h)
    return replace(
        decision, alert=decision.alert.released(n_off), danger=decision.danger.released(n_off)
    )


def readings_of(duration_h: float, reading_h: float) -> int:
    """Readings that stand for running hours: at least one."""
    return max(1, math.ceil(duration_h / reading_h - 1e-9))


def least_step_ns(baseline: QuantityBaseline) -> int:
    """Time after one reading before the next one counts."""
    return round(0.5 * baseline.reading_h * 3600.0 * NS_PER_S)


def _unusable(reading: WatchedReading) -> Verdict | None:
    if not reading.is_settled:
        return Verdict.TRANSIENT
    if reading.evidence in OF_EVIDENCE:
        return OF_EVIDENCE[reading.evidence]
    return Verdict.BAD_QUALITY if math.isnan(reading.value) else None


def _compared(
    decision: Decision,
    reading: WatchedReading,
    condition: FilmConditions,
    baseline: QuantityBaseline,
    limits: ChangeLimits,
) -> Decision:
    found = baseline.compare(condition, np.array([reading.value]), np.array([reading.u_random]))
    if found.place[0] < 0:
        return replace(decision, verdict=Verdict.NO_BASELINE)
    last_ns = decision.last_counted_ns
    if last_ns is not None and reading.time_ns - last_ns < least_step_ns(baseline):
        return replace(decision, verdict=_verdict(decision, baseline, limits))
    counted = Counted(
        *(
            float(column[0])
            for column in (found.deviation, found.weight, found.scatter, found.offset_std)
        )
    )
    evidence = decision.evidence.step(counted, baseline)
    decision = replace(
        decision,
        deviation=counted.deviation,
        deviation_std=_deviation_std(counted, reading, baseline),
        evidence=evidence,
        last_counted_ns=reading.time_ns,
    )
    return _judged(decision, evidence.findings(baseline), baseline, limits)


def _deviation_std(counted: Counted, reading: WatchedReading, baseline: QuantityBaseline) -> float:
    excess = max(reading.u_random**2 - baseline.u_random**2, 0.0)
    return math.sqrt(counted.scatter**2 + excess + counted.offset_std**2)


def _judged(
    decision: Decision,
    findings: tuple[Finding, ...],
    baseline: QuantityBaseline,
    limits: ChangeLimits,
) -> Decision:
    n_on = readings_of(limits.on_delay_h, baseline.reading_h)
    n_off = readings_of(limits.off_delay_h, baseline.reading_h)
    alert, danger = (
        timer.step(
            any(_is_passed(finding, change, margin, limits) for finding in findings),
            any(_is_held(finding, change, limits) for finding in findings),
            n_on,
            n_off,
            limits.is_latching,
        )
        for timer, change, margin in (
            (decision.alert, limits.alert_change, ALERT_MARGIN),
            (decision.danger, limits.danger_change, DANGER_MARGIN),
        )
    )
    strongest = max(findings, key=lambda finding: finding.significance, default=None)
    decision = replace(decision, finding=strongest, alert=alert, danger=danger)
    return replace(decision, verdict=_verdict(decision, baseline, limits))


def _is_passed(finding: Finding, limit: float, margin: float, limits: ChangeLimits) -> bool:
    """Whether a change is sure, and surely beyond the limit."""
    significance, sure = finding.significance, limits.sure_from(finding.time_scale_h)
    is_beyond = sure_size(finding.change, significance, margin) >= limit
    return significance >= sure and bool(is_beyond)


def _is_held(finding: Finding, limit: float, limits: ChangeLimits) -> bool:
    """Whether it still is, with the deadband."""
    sure = limits.sure_from(finding.time_scale_h) * limits.holding_share
    return finding.significance > sure and abs(finding.change) > limit - limits.deadband


def _verdict(decision: Decision, baseline: QuantityBaseline, limits: ChangeLimits) -> Verdict:
    counted_h = decision.evidence.n_counted * baseline.reading_h
    is_enough = decision.finding is not None and counted_h >= limits.min_evidence_h
    # what is beyond its limit, though not for long enough, is not normal either
    return counted_verdict(decision.level, is_enough and not decision.alert.n_passed)
