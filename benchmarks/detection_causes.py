"""Causes that are named for changed films after a week of running."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.simulated.life.damage import Damage, DamageKind
from acquisition.simulated.life.operation import HeldLoad
from benchmarks.detection_unit import DAY_NS, START_NS, LearnedUnit, raised
from core.baseline.history import DIRECTIONS, QUANTITIES
from core.change.cause import Cause
from core.change.decision import JUDGED

ROWS_PER_H = 6
TOLD_AFTER_H = 7 * 24
"""Running hours after onset at which the cause is looked at."""

BEFORE_ROWS, MARGIN_DAYS = 3000, 60
"""Readings before onset from which decisions are led on, and days between onset and the end."""


@dataclass(frozen=True)
class CauseCase:
    """Damage of one bearing (or of all), and the cause to be told.

    Parameters
    ----------
    sizes
        Sizes by kind of damage.
    cause
        Cause that is right; None where only the change is to be found.
    directions
        Number of directions in which transducers are damaged.
    within_days
        Days after onset within which the change must be found.
    """

    name: str
    sizes: dict[DamageKind, float]
    cause: Cause | None
    is_everywhere: bool = False
    directions: int = 2
    within_days: float | None = None


def lost_by_clearance(growth: float) -> float:
    """Size of `CLEARANCE_GROWTH` for a relative growth of the clearance."""
    return 1.0 - (1.0 + growth) ** -3


GROWTH, OIL = DamageKind.CLEARANCE_GROWTH, DamageKind.OIL_DEGRADATION
CAUSE_CASES = (
    CauseCase("oil 20 % thinner", {OIL: 0.2}, Cause.OIL, is_everywhere=True),
    CauseCase("clearance +10 %", {GROWTH: lost_by_clearance(0.1)}, Cause.CLEARANCE),
    CauseCase("bracket −15 %", {DamageKind.BRACKET_LOOSENING: 0.15}, Cause.BRACKET),
    CauseCase(
        *("accelerometer −5 %", {DamageKind.ACCELEROMETER_GAIN: -0.05}, Cause.TRANSDUCER),
        directions=1,
    ),
    CauseCase("probe +5 %", {DamageKind.PROBE_GAIN: 0.05}, Cause.TRANSDUCER, directions=1),
    CauseCase(
        "clearance +5 %, k kept by thicker oil",
        {GROWTH: lost_by_clearance(0.05), OIL: 1.0 - 1.05**3},
        None,
        within_days=14.0,
    ),
)


TWO_SHIFTS = HeldLoad(START_NS, 0.9, ((6.0, 11.0), (17.0, 22.0)))
"""Two runs of five hours a day."""


@dataclass(frozen=True)
class Told:
    """What was found of one change.

    Parameters
    ----------
    by_k, by_ck
        Whether an alarm by k, and by c/k, was active at the end.
    cause, reason
        Cause of the worst film; None without an alarm.
    """

    by_k: bool
    by_ck: bool
    cause: Cause | None = None
    reason: str = ""


def tell(unit: LearnedUnit, case: CauseCase, random: np.random.Generator) -> Told:
    """Let a change set in when a bearing is judged, and tell its cause."""
    bearing, time_ns = str(random.choice(list(unit.baselines))), unit.healthy.time_ns
    rows = unit.judged_rows(bearing)
    is_in = (rows >= BEFORE_ROWS) & (time_ns[rows] < time_ns[-1] - MARGIN_DAYS * DAY_NS)
    onset = int(random.choice(rows[is_in]))
    axis = str(random.choice(list(DIRECTIONS)))
    directions = DIRECTIONS if case.directions == 2 else (axis,)
    damage = [
        Damage(kind, one, int(time_ns[onset]), size, directions=directions)
        for one in (unit.baselines if case.is_everywhere else [bearing])
        for kind, size in case.sizes.items()
    ]
    end = onset + TOLD_AFTER_H * ROWS_PER_H
    if case.within_days is not None:
        end = int(np.searchsorted(time_ns, time_ns[onset] + round(case.within_days * DAY_NS)))
    later = unit.later(damage).rows(onset - BEFORE_ROWS, min(end, time_ns.size))
    levels = {
        quantity: bool(unit.decide(later, bearing, quantity).level[-1]) for quantity in QUANTITIES
    }
    for direction, line in unit.lines(later, later.time_ns.size - 1).items():
        levels[f"k_{direction}"] |= line.is_alarming and line.bearing == bearing
    by_k, by_ck = (any(levels[f"{name}_{d}"] for d in DIRECTIONS) for name in ("k", "ck"))
    if not by_k and not by_ck:
        return Told(False, False)
    sizes = {d: abs(unit.last_change(later, bearing, f"k_{d}")) for d in DIRECTIONS}
    held = [d for d in DIRECTIONS if levels[f"k_{d}"] or levels[f"ck_{d}"]]
    worst = max(held, key=sizes.__getitem__)
    found = unit.attribution(later, (bearing, worst), later.time_ns.size - 1)
    return Told(by_k, by_ck, found.cause, found.reason)


def judged_per_day(seed: int) -> tuple[float, int]:
    """Readings judged per day of a healthy two-shift unit, of the worst film, and false alarms."""
    unit = LearnedUnit(seed, TWO_SHIFTS)
    decided = [unit.decide(unit.healthy, *place) for place in unit.watched()]
    judged = [np.isin(one.verdict, [int(each) for each in JUDGED]).sum() for one in decided]
    n_alarms = sum(raised(one).size for one in decided)
    return float(min(judged)) / (365.25 * unit.healthy.years), n_alarms


def shares(told: Sequence[Told], cause: Cause) -> tuple[float, float]:
    """Shares of changes whose cause was told rightly, and wrongly."""
    right = float(np.mean([each.cause is cause for each in told]))
    silent = (None, Cause.UNKNOWN)
    wrong = [each.cause not in (cause, *silent) for each in told]
    return right, float(np.mean(wrong))
