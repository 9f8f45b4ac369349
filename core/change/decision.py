"""Decision whether a film has changed: verdict, alert and danger, updated with each reading."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TypeAlias

import numpy as np

from core.arrays import BoolArray, FloatArray
from core.baseline.baseline import QuantityBaseline
from core.baseline.history import CodeArray, ReadingOutcome
from core.change.evidence import NO_EVIDENCE, Comparison, Finding, GatheredEvidence
from core.change.settings import ALERT_MARGIN, DANGER_MARGIN, MIN_SIGNIFICANCE, ChangeLimits
from core.condition.cells import FilmConditions
from core.limits import INACTIVE, AlarmLevel, DelayTimer
from core.units import NS_PER_S


class Verdict(IntEnum):
    """Verdict on a reading of a film; from `GATHERING_EVIDENCE` on, why it was not judged."""

    NORMAL = 0
    ALERT = 1
    DANGER = 2
    GATHERING_EVIDENCE = 3
    NO_BASELINE = 4
    INSUFFICIENT_EXCITATION = 5
    BAD_QUALITY = 6
    TRANSIENT = 7


JUDGED = (Verdict.NORMAL, Verdict.ALERT, Verdict.DANGER)
"""Verdicts on a reading that was judged."""

Outcome: TypeAlias = Comparison | Verdict
"""Comparison of a reading with its baseline, or a verdict if it cannot be compared."""


def outcomes(
    conditions: FilmConditions,
    value: FloatArray,
    u_random: FloatArray,
    codes: CodeArray,
    is_settled: BoolArray,
    baseline: QuantityBaseline | None,
) -> Iterator[Outcome]:
    """Yield, for each reading of a film in one direction, its comparison with the baseline.

    A verdict is yielded instead if a reading is not settled or cannot be compared, or if there is
    no baseline. All arrays are (n,): `value` is ln of the stiffness (NaN if not measured),
    `u_random` its random standard uncertainty, and `codes` are values of `ReadingOutcome` of the
    stiffness, which explain a missing value.
    """
    unusable = np.full(value.size, -1)
    columns: tuple[FloatArray, ...] = (np.zeros(value.size),) * 4
    if baseline is None:
        unusable[:] = Verdict.NO_BASELINE
    else:
        found = baseline.compare(conditions, value, u_random)
        unusable[found.place < 0] = Verdict.NO_BASELINE
        unusable[~baseline.is_known(conditions)] = Verdict.BAD_QUALITY
        columns = (found.deviation, found.weight, found.scatter, found.offset_std)
    is_missing, is_quiet = np.isnan(value), codes == ReadingOutcome.INSUFFICIENT_EXCITATION
    unusable[is_missing] = Verdict.BAD_QUALITY
    unusable[is_missing & is_quiet] = Verdict.INSUFFICIENT_EXCITATION
    unusable[~is_settled] = Verdict.TRANSIENT
    rows = zip(*(column.tolist() for column in (*columns, u_random)), strict=True)
    for why, row in zip(unusable.tolist(), rows, strict=True):
        yield Comparison(*row) if why < 0 else Verdict(why)


@dataclass(frozen=True, slots=True)
class Decision:
    """State of the decision on a film in one direction; fields that are None have no value yet.

    A reading counts if it was compared with the baseline; see `step`.

    Parameters
    ----------
    verdict
        Verdict on the newest reading.
    finding
        Mean deviation over the time scale for which it is most significant, after the newest
        counted reading.
    deviation, deviation_std
        Deviation of the newest counted reading from its baseline, in ln, and its standard
        uncertainty.
    evidence
        Number of counted readings, and their sums over each time scale.
    alert, danger
        Delay timers of the levels alert and danger.
    last_ns, last_counted_ns
        Times of the newest reading and of the newest counted reading.
    """

    verdict: Verdict = Verdict.GATHERING_EVIDENCE
    finding: Finding | None = None
    deviation: float | None = None
    deviation_std: float | None = None
    evidence: GatheredEvidence = NO_EVIDENCE
    alert: DelayTimer = INACTIVE
    danger: DelayTimer = INACTIVE
    last_ns: int | None = None
    last_counted_ns: int | None = None

    @property
    def level(self) -> AlarmLevel | None:
        """Active alarm level, even if the newest reading was not judged; None if inactive."""
        if self.danger.is_on:
            return AlarmLevel.DANGER
        return AlarmLevel.ALERT if self.alert.is_on else None


INITIAL_DECISION = Decision()
"""Decision before the first reading, and after a change of baseline."""


def step(
    decision: Decision,
    time_ns: int,
    outcome: Outcome,
    baseline: QuantityBaseline | None,
    limits: ChangeLimits,
) -> Decision:
    """Return a decision updated with the outcome of one reading.

    A reading does not count if it is less than half a reading interval after the previous counted
    reading, because both share most of their samples. Without a baseline, no reading is judged.

    Raises ValueError if the reading is not later than the previous reading, or the evidence so far
    is from a baseline with another number of time scales.
    """
    if decision.last_ns is not None and time_ns <= decision.last_ns:
        raise ValueError(
            f"reading at {time_ns} ns must be after the previous reading at {decision.last_ns} ns"
        )
    if baseline is None or isinstance(outcome, Verdict):
        verdict = outcome if isinstance(outcome, Verdict) else Verdict.NO_BASELINE
        return replace(decision, verdict=verdict, last_ns=time_ns)
    last_ns = decision.last_counted_ns
    half_ns = round(0.5 * baseline.reading_h * 3600.0 * NS_PER_S)
    if last_ns is not None and time_ns - last_ns < half_ns:
        before = (decision.evidence, decision.finding, decision.alert, decision.danger)
        return replace(decision, verdict=_verdict(*before, baseline, limits), last_ns=time_ns)
    evidence = decision.evidence.step(outcome, baseline)
    findings = evidence.findings(baseline)
    finding = max(findings, key=lambda finding: finding.significance, default=None)
    # nearly always; no limit is exceeded then
    is_quiet = finding is None or finding.significance < MIN_SIGNIFICANCE
    alert, danger = (
        INACTIVE
        if is_quiet and not timer.is_on
        else _level_step(timer, time_ns, findings, change, margin, baseline, limits)
        for timer, change, margin in (
            (decision.alert, limits.alert_change, ALERT_MARGIN),
            (decision.danger, limits.danger_change, DANGER_MARGIN),
        )
    )
    return Decision(
        verdict=_verdict(evidence, finding, alert, danger, baseline, limits),
        finding=finding,
        deviation=outcome.deviation,
        deviation_std=_deviation_std(outcome, baseline),
        evidence=evidence,
        alert=alert,
        danger=danger,
        last_ns=time_ns,
        last_counted_ns=time_ns,
    )


def _deviation_std(compared: Comparison, baseline: QuantityBaseline) -> float:
    excess = max(compared.u_random**2 - baseline.u_random**2, 0.0)
    return math.sqrt(compared.scatter**2 + excess + compared.offset_std**2)


def _level_step(
    timer: DelayTimer,
    time_ns: int,
    findings: list[Finding],
    limit: float,
    margin: float,
    baseline: QuantityBaseline,
    limits: ChangeLimits,
) -> DelayTimer:
    """Return the updated timer of a level; delays are whole numbers of readings, at least one."""
    if timer.is_on:
        wanted = any(_is_held(finding, limit, limits) for finding in findings)
    else:
        wanted = any(_is_exceeded(finding, limit, margin, limits) for finding in findings)
    reading_ns = round(baseline.reading_h * 3600.0 * NS_PER_S)
    on_delay_ns, off_delay_ns = (
        max(1, math.ceil(delay_h / baseline.reading_h - 1e-9)) * reading_ns
        for delay_h in (limits.on_delay_h, limits.off_delay_h)
    )
    return timer.step(wanted, time_ns, on_delay_ns, off_delay_ns, reading_ns)


def _is_exceeded(finding: Finding, limit: float, margin: float, limits: ChangeLimits) -> bool:
    """Whether a change is significant, and exceeds the limit by `margin` standard uncertainties."""
    significance = finding.significance
    threshold = limits.significance_threshold(finding.time_scale_h)
    surely = finding.change * (1.0 - margin / max(significance, 1e-9))
    return significance >= threshold and abs(math.expm1(surely)) >= limit


def _is_held(finding: Finding, limit: float, limits: ChangeLimits) -> bool:
    """Whether a change still exceeds the limit minus the deadband."""
    threshold = limits.significance_threshold(finding.time_scale_h) * limits.holding_share
    size = abs(math.expm1(finding.change))
    return finding.significance > threshold and size > limit - limits.deadband


def _verdict(
    evidence: GatheredEvidence,
    finding: Finding | None,
    alert: DelayTimer,
    danger: DelayTimer,
    baseline: QuantityBaseline,
    limits: ChangeLimits,
) -> Verdict:
    """Return the verdict on a reading that was compared with its baseline."""
    if danger.is_on or alert.is_on:
        return Verdict.DANGER if danger.is_on else Verdict.ALERT
    counted_h = evidence.n_counted * baseline.reading_h
    is_enough = finding is not None and counted_h >= limits.min_evidence_h
    # a change beyond the limit is not normal, even before the on-delay has elapsed
    is_normal = is_enough and alert.opposed_ns == 0
    return Verdict.NORMAL if is_normal else Verdict.GATHERING_EVIDENCE
