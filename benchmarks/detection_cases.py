"""What happens to simulated units in their second year, and what is said of it."""

from dataclasses import dataclass

import numpy as np

from acquisition.simulated.life.damage import Damage, DamageKind
from acquisition.simulated.life.shaft import ConditionChange
from benchmarks.detection_unit import DAY_NS, Later, LearnedUnit, raised
from core.baseline.history import DIRECTIONS, QUANTITIES
from core.change.cause import Cause
from core.change.decision import Verdict

ROWS_PER_H = 6
MARGIN_DAYS = 100
"""Damage sets in at least so long before the end."""

ATTRIBUTED_AFTER_H = 24
"""Running hours after the alarm when its cause is looked at again."""


CENTRED, OUTWARD = 0.12, 0.60
WARM_C, COLD_C = 3.0, -3.0


def four_fold(
    start_ns: int, days: float = 30.0, *, stiffer: bool = True
) -> tuple[ConditionChange, ConditionChange]:
    """Return two condition changes that make healthy films about four times stiffer, or softer.

    For `days` before `start_ns` the shaft runs near the centre in warm oil, then for `days` at high
    eccentricity in cold oil; in reverse order if not `stiffer`. The factor is 3.5 to 8 in the most
    sensitive direction, depending on the machine. A healthy machine has both conditions in spring
    and autumn; the colder oil may be unusual in midwinter, the warmer oil in midsummer.
    """
    first, second = (CENTRED, WARM_C), (OUTWARD, COLD_C)
    if not stiffer:
        first, second = second, first
    span_ns = round(days * DAY_NS)
    return (
        ConditionChange(start_ns - span_ns, start_ns, *first),
        ConditionChange(start_ns, start_ns + span_ns, *second),
    )


def cooling_failure(
    start_ns: int, days: float = 5.0, oil_offset_c: float = 12.0
) -> ConditionChange:
    """Return the change caused by a failed cooler: oil warmer than in any healthy history."""
    return ConditionChange(start_ns, start_ns + round(days * DAY_NS), oil_offset_c=oil_offset_c)


@dataclass(frozen=True)
class DamageCase:
    """Damage, and by when it must be found.

    Parameters
    ----------
    within_h, within_days
        Running hours or days after onset; the former counts whenever the shaft turns.
    anywhere
        Onset at any time the shaft turns, instead of when films are being judged.
    """

    name: str
    kind: DamageKind
    size: float
    least_share: float | None
    ramp_days: float = 0.0
    within_h: float | None = None
    within_days: float | None = None
    directions: tuple[str, ...] = DIRECTIONS
    anywhere: bool = False


LOSS = DamageKind.STIFFNESS_LOSS
DAMAGE_CASES = (
    DamageCase("20 % loss, step, within 24 h", LOSS, 0.2, 0.99, within_h=24.0),
    DamageCase("10 % loss, step, within 48 h", LOSS, 0.1, 0.95, within_h=48.0),
    DamageCase("5 % loss, step, within 14 days", LOSS, 0.05, 0.90, within_days=14.0),
    DamageCase("10 % loss over 90 days", LOSS, 0.1, 0.95, ramp_days=90.0, within_days=90.0),
    DamageCase(
        *("accelerometer gain −20 %, within 24 h", DamageKind.ACCELEROMETER_GAIN, -0.2, 0.99),
        within_h=24.0,
        directions=("x",),
    ),
    DamageCase("20 % loss at any hour, within 24 h", LOSS, 0.2, None, within_h=24.0, anywhere=True),
    DamageCase("10 % loss at any hour, within 48 h", LOSS, 0.1, None, within_h=48.0, anywhere=True),
    DamageCase(
        "5 % loss at any hour, within 14 days", LOSS, 0.05, None, within_days=14.0, anywhere=True
    ),
)


@dataclass(frozen=True)
class Found:
    """What became of one damage.

    Parameters
    ----------
    after_h
        Running hours to the alarm; None if there was none in time.
    by_fixed
        Whether a fixed threshold saw it in time.
    cause, cause_later
        What it was put down to at the alarm, and a day of running later.
    """

    after_h: float | None
    by_fixed: bool
    cause: Cause | None = None
    cause_later: Cause | None = None


def find_damage(
    unit: LearnedUnit, case: DamageCase, random: np.random.Generator, band: float
) -> Found:
    bearing = str(random.choice(list(unit.baselines)))
    time_ns = unit.healthy.time_ns
    last_onset = int(np.searchsorted(time_ns, time_ns[-1] - MARGIN_DAYS * DAY_NS))
    rows = np.arange(last_onset) if case.anywhere else unit.judged_rows(bearing)
    onset = int(random.choice(rows[rows < last_onset]))
    onset_ns = int(time_ns[onset])
    damage = Damage(case.kind, bearing, onset_ns, case.size, case.ramp_days, case.directions)
    later = unit.later([damage])
    end = _end(later, onset, case)
    later = later.rows(0, end + ATTRIBUTED_AFTER_H * ROWS_PER_H)
    alarms = [
        (int(row), (bearing, QUANTITIES[quantity].direction))
        for quantity in QUANTITIES
        for row in raised(unit.decide(later, bearing, quantity))
        if onset <= row < end
    ]
    by_fixed = any(
        np.any((raised >= onset) & (raised < end))
        for raised in (_fixed(unit, later, bearing, d, band) for d in DIRECTIONS)
    )
    if not alarms:
        return Found(None, by_fixed)
    row, place = min(alarms)
    later_row = min(row + ATTRIBUTED_AFTER_H * ROWS_PER_H, later.time_ns.size - 1)
    causes = (unit.attribution(later, place, r).cause for r in (row, later_row))
    return Found((row - onset) / ROWS_PER_H, by_fixed, *causes)


def _end(later: Later, onset: int, case: DamageCase) -> int:
    if case.within_h is not None:
        return onset + round(case.within_h * ROWS_PER_H)
    until_ns = later.time_ns[onset] + round((case.within_days or 0.0) * DAY_NS)
    return int(np.searchsorted(later.time_ns, until_ns))


def _fixed(
    unit: LearnedUnit, later: Later, bearing: str, direction: str, band: float
) -> np.ndarray:
    ln_k = later.histories[bearing].ln_k[DIRECTIONS.index(direction)]
    return unit.fixed[bearing, direction].raised(ln_k, later.is_settled, band)


def false_alarms(unit: LearnedUnit, band: float) -> tuple[int, int]:
    """Alarms of a healthy unit: by decision and shaft line, and by a fixed threshold."""
    decisions, crossings = _alarms(unit, unit.healthy, 0, unit.healthy.time_ns.size, band)
    return decisions + len(unit.line_alarms(unit.healthy)), crossings


def _alarms(unit: LearnedUnit, later: Later, first: int, end: int, band: float) -> tuple[int, int]:
    decided = [raised(unit.decide(later, *place)) for place in unit.watched()]
    fixed = [_fixed(unit, later, *place, band) for place in unit.places()]
    decisions, crossings = (
        sum(int(np.sum((rows >= first) & (rows < end))) for rows in found)
        for found in (decided, fixed)
    )
    return decisions, crossings


@dataclass(frozen=True)
class Changed:
    """What a change of condition alone did.

    Parameters
    ----------
    factor
        By which stiffness changed, in the median over directions and bearings.
    """

    alarms: int
    fixed_alarms: int
    factor: float


CHANGE_DAYS, AFTER_DAYS = 30.0, 5.0


def change_condition(
    unit: LearnedUnit, stiffer: bool, random: np.random.Generator, band: float
) -> Changed:
    start_ns = int(unit.healthy.time_ns[0]) + round(random.uniform(40.0, 300.0) * DAY_NS)
    later = unit.later(changes=four_fold(start_ns, CHANGE_DAYS, stiffer=stiffer))
    edges_ns = start_ns + np.round(np.array([-1.0, 0.0, 1.0]) * CHANGE_DAYS * DAY_NS)
    first, middle, end = (int(np.searchsorted(later.time_ns, edge)) for edge in edges_ns)
    factors = []
    for bearing, direction in unit.places():
        ln_k = later.histories[bearing].ln_k[DIRECTIONS.index(direction)].copy()
        ln_k[~later.is_settled] = np.nan
        if np.isfinite(ln_k[first:middle]).any() and np.isfinite(ln_k[middle:end]).any():
            factors.append(np.nanmedian(ln_k[middle:end]) - np.nanmedian(ln_k[first:middle]))
    last = int(np.searchsorted(later.time_ns, edges_ns[2] + AFTER_DAYS * DAY_NS))
    factor = float(np.exp(np.median(factors))) if factors else float("nan")
    return Changed(*_alarms(unit, later, first, last, band), factor)


@dataclass(frozen=True)
class Outside:
    """What was said of a condition never seen.

    Parameters
    ----------
    no_baseline_share
        Of settled readings with a number meanwhile; the rest lies in the support after all.
    """

    alarms: int
    fixed_alarms: int
    no_baseline_share: float


OUTSIDE_DAYS, OIL_OFFSET_C = 8.0, 20.0
"""Water varies by 9 K over the year and by 6 K with the weather, oil by 4 K with load: 20 K are
beyond all of it."""

WITHOUT_NUMBER = (Verdict.TRANSIENT, Verdict.INSUFFICIENT_EXCITATION, Verdict.BAD_QUALITY)


def leave_support(
    unit: LearnedUnit, is_damaged: bool, random: np.random.Generator, band: float
) -> Outside:
    """Let the cooling fail, and a film soften a day later."""
    time_ns = unit.healthy.time_ns
    settled = np.flatnonzero(unit.healthy.is_settled & (time_ns < time_ns[-1] - 20 * DAY_NS))
    start_ns = int(time_ns[random.choice(settled)])
    bearing = str(random.choice(list(unit.baselines)))
    damage = [Damage(LOSS, bearing, start_ns + DAY_NS, 0.2)] if is_damaged else []
    later = unit.later(damage, [cooling_failure(start_ns, OUTSIDE_DAYS, OIL_OFFSET_C)])
    first_ns, end_ns = start_ns + DAY_NS, start_ns + round(OUTSIDE_DAYS * DAY_NS)
    first, end = (int(np.searchsorted(later.time_ns, ns)) for ns in (first_ns, end_ns))
    verdicts = np.stack([unit.decide(later, *place).verdict for place in unit.watched()])
    said = verdicts[:, first:end]
    said = said[~np.isin(said, WITHOUT_NUMBER)]
    share = float(np.mean(said == Verdict.NO_BASELINE)) if said.size else float("nan")
    return Outside(*_alarms(unit, later, first, end, band), share)
