"""Decisions over a whole history at once: what `advance` says reading by reading."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, TimeArray
from core.baseline.baseline import QuantityBaseline
from core.baseline.stiffness_history import DIRECTIONS, CodeArray, StiffnessHistory
from core.baseline.watched import watched_values
from core.change.decision import least_step_ns, readings_of
from core.change.finding_history import FindingHistory, finding_history
from core.change.level_history import level_history
from core.change.settings import ALERT_MARGIN, DANGER_MARGIN, ChangeLimits, sure_size
from core.change.verdict import OF_EVIDENCE, Verdict

_Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class DecisionHistory:
    """The decision after every reading.

    Parameters
    ----------
    verdict : (n,)
        Members of `Verdict`.
    level : (n,)
        Level that is held: 0 for none, or a member of `AlarmLevel`.
    change, significance, time_scale_h : (n,)
        The most significant mean deviation; NaN before there is one.
    """

    verdict: CodeArray
    level: CodeArray
    change: FloatArray
    significance: FloatArray
    time_scale_h: FloatArray

    def raised(self) -> npt.NDArray[np.int64]:
        """Rows in which a level rises."""
        return np.flatnonzero(np.diff(self.level, prepend=np.int8(0)) > 0)


def back_test(
    history: StiffnessHistory,
    is_settled: _Bools,
    baseline: QuantityBaseline,
    limits: ChangeLimits,
) -> DecisionHistory:
    """Decide over a history, beginning with nothing decided.

    Parameters
    ----------
    is_settled : (n,)
        Whether the unit had settled in a steady state.
    """
    conditions = history.conditions
    value, u_random = watched_values(history, baseline.quantity, baseline.direction)
    unusable = _unusable(history, is_settled, baseline, np.isfinite(value))
    found = baseline.compare(conditions, value, u_random)
    is_comparable = (unusable < 0) & (found.place >= 0)
    counted = _spaced(history.time_ns, is_comparable, least_step_ns(baseline))
    findings = finding_history(found, counted, baseline)
    judged = _judged(findings, baseline, limits)
    verdict = np.where(is_comparable, 0, Verdict.NO_BASELINE).astype(np.int8)
    verdict[unusable >= 0] = unusable[unusable >= 0]
    return _spread(judged, verdict, is_comparable, counted)


def _unusable(
    history: StiffnessHistory,
    is_settled: _Bools,
    baseline: QuantityBaseline,
    is_there: _Bools,
) -> CodeArray:
    """(n,) why a reading cannot be used; -1 if it can."""
    is_known = baseline.is_known(history.conditions) & is_there
    why = np.where(is_known, -1, Verdict.BAD_QUALITY).astype(np.int8)
    evidence = history.evidence[DIRECTIONS.index(baseline.direction)]
    for said, verdict in OF_EVIDENCE.items():
        why[evidence == said] = verdict
    why[~is_settled] = Verdict.TRANSIENT
    return why


def _spaced(time_ns: TimeArray, is_comparable: _Bools, least_ns: int) -> npt.NDArray[np.int64]:
    """Rows that count: comparable, and not too soon after the last one that counted."""
    rows = np.flatnonzero(is_comparable)
    if rows.size == 0 or np.all(np.diff(time_ns[rows]) >= least_ns):
        return rows
    kept = [int(rows[0])]
    for row in rows[1:].tolist():
        if time_ns[row] - time_ns[kept[-1]] >= least_ns:
            kept.append(row)
    return np.array(kept)


def _judged(
    findings: FindingHistory, baseline: QuantityBaseline, limits: ChangeLimits
) -> DecisionHistory:
    """Decision after each counted reading."""
    alert, danger = (
        _level(findings, limit, margin, baseline, limits)
        for limit, margin in (
            (limits.alert_change, ALERT_MARGIN),
            (limits.danger_change, DANGER_MARGIN),
        )
    )
    level = np.where(danger, 2, np.where(alert, 1, 0)).astype(np.int8)
    seen_h = np.arange(1, level.size + 1) * baseline.reading_h
    is_enough = findings.is_found & (seen_h >= limits.min_evidence_h)
    is_enough &= ~_is_passed(findings, limits.alert_change, ALERT_MARGIN, limits)
    quiet = np.where(is_enough, Verdict.NORMAL, Verdict.GATHERING_EVIDENCE)
    verdict = np.where(level > 0, level, quiet).astype(np.int8)
    return DecisionHistory(verdict, level, *findings.strongest())


def _level(
    findings: FindingHistory,
    limit: float,
    margin: float,
    baseline: QuantityBaseline,
    limits: ChangeLimits,
) -> _Bools:
    size, significance = np.abs(findings.change), findings.significance
    sure = _sure(findings, limits)
    is_held = (size > limit - limits.deadband) & (significance > sure * limits.holding_share)
    return level_history(
        _is_passed(findings, limit, margin, limits),
        np.asarray(is_held.any(axis=0)),
        readings_of(limits.on_delay_h, baseline.reading_h),
        readings_of(limits.off_delay_h, baseline.reading_h),
        limits.is_latching,
    )


def _is_passed(
    findings: FindingHistory, limit: float, margin: float, limits: ChangeLimits
) -> _Bools:
    """(n,) whether a change is sure, and surely beyond the limit, on any time scale."""
    sure = _sure(findings, limits)
    is_beyond = sure_size(findings.change, findings.significance, margin) >= limit
    return np.asarray(np.any((findings.significance >= sure) & is_beyond, axis=0))


def _sure(findings: FindingHistory, limits: ChangeLimits) -> FloatArray:
    """(n_scales, 1) significance from which a mean is sure."""
    sure = [limits.sure_from(time_h) for time_h in findings.time_scales_h]
    return np.array(sure).reshape(-1, 1)


def _spread(
    judged: DecisionHistory,
    verdict: CodeArray,
    is_comparable: _Bools,
    counted: npt.NDArray[np.int64],
) -> DecisionHistory:
    """Carry what the counted readings say to those that follow, but not their verdict to others."""
    has_counted = np.zeros(verdict.size, np.bool_)
    has_counted[counted] = True
    latest = np.cumsum(has_counted) - 1
    if not counted.size:
        nothing = np.full(verdict.size, np.nan)
        return DecisionHistory(verdict, np.zeros_like(verdict), nothing, nothing, nothing)
    verdict[is_comparable] = judged.verdict[latest[is_comparable]]
    level = np.where(latest >= 0, judged.level[latest], 0).astype(np.int8)
    change, significance, time_h = (
        np.where(latest >= 0, column[latest], np.nan)
        for column in (judged.change, judged.significance, judged.time_scale_h)
    )
    return DecisionHistory(verdict, level, change, significance, time_h)
