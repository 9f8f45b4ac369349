"""The table: what is required, what was found, and what a fixed threshold would have said."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.simulated.life.damage import DamageKind
from benchmarks.detection_cases import DAMAGE_CASES, Changed, DamageCase, Found, Outside
from benchmarks.detection_causes import CAUSE_CASES, CauseCase, Told, shares
from core.change.cause import Cause

MOST_FALSE_ALARMS = 0.1
"""Per unit-year, all bearings and directions counted."""

HEADINGS = ("case", "required", "found", "n", "fixed threshold", "verdict")


@dataclass(frozen=True)
class UnitResult:
    """Everything about one unit; pairs are the sequential test and the fixed threshold."""

    years: float
    false_alarms: tuple[int, int]
    found: Mapping[str, Found]
    changed: tuple[Changed, ...]
    outside: Mapping[bool, Outside]
    told: Mapping[str, Told]
    two_shifts: tuple[float, int] | None


@dataclass(frozen=True)
class Line:
    """One line of the table; `is_met` is None where nothing is required."""

    case: str
    required: str
    found: str
    n: int
    fixed: str = ""
    is_met: bool | None = None


def lines(results: Sequence[UnitResult]) -> Iterator[Line]:
    yield _healthy(results)
    for case in DAMAGE_CASES:
        found = [result.found[case.name] for result in results]
        yield _damage(case, found)
        if not case.anywhere and (case.size == 0.2 or case.kind is DamageKind.ACCELEROMETER_GAIN):
            yield from _causes(case, found)
    yield _changes([one for result in results for one in result.changed])
    for is_damaged, name in ((False, "outside the support"), (True, "the same, with 20 % loss")):
        yield _outside(name, [result.outside[is_damaged] for result in results])
    for cause_case in CAUSE_CASES:
        yield _told(cause_case, [result.told[cause_case.name] for result in results])
    yield from _two_shifts([r.two_shifts for r in results if r.two_shifts is not None])


LEAST_RIGHT, MOST_WRONG = 0.9, 0.02


def _told(case: CauseCase, told: Sequence[Told]) -> Line:
    if case.cause is None:
        found = float(np.mean([one.by_ck for one in told]))
        kept = f"{100 * found:.1f} % by c/k, {100 * np.mean([one.by_k for one in told]):.1f} % by k"
        return Line(case.name, "≥ 90 % by c/k", kept, len(told), is_met=found >= LEAST_RIGHT)
    right, wrong = shares(told, case.cause)
    alarms = np.mean([one.cause is not None for one in told])
    return Line(
        f"{case.name}, cause in 7 running days",
        "right ≥ 90 %, wrong ≤ 2 %",
        f"right {100 * right:.1f} %, wrong {100 * wrong:.1f} % (alarm {100 * alarms:.1f} %)",
        len(told),
        "cannot say",
        right >= LEAST_RIGHT and wrong <= MOST_WRONG,
    )


def _two_shifts(found: Sequence[tuple[float, int]]) -> Iterator[Line]:
    if found:
        least, alarms = min(per_day for per_day, _ in found), sum(n for _, n in found)
        words = f"≥ {least:.1f} readings a day, {alarms} alarms"
        name = "two runs of 5 h a day, healthy: judged"
        yield Line(name, "judged", words, len(found), is_met=least > 0.0)


def _healthy(results: Sequence[UnitResult]) -> Line:
    years = sum(result.years for result in results)
    ours, fixed = (sum(r.false_alarms[i] for r in results) / years for i in (0, 1))
    return Line(
        "healthy: false alarms per unit-year",
        f"≤ {MOST_FALSE_ALARMS:g}",
        f"{ours:.3f}",
        len(results),
        f"{fixed:.3f}",
        ours <= MOST_FALSE_ALARMS,
    )


def _damage(case: DamageCase, found: Sequence[Found]) -> Line:
    hours = [one.after_h for one in found if one.after_h is not None]
    share = len(hours) / len(found)
    median = f", median {np.median(hours):.0f} h" if hours else ""
    return Line(
        case.name,
        "" if case.least_share is None else f"≥ {100 * case.least_share:.0f} %",
        f"{100 * share:.1f} %{median}",
        len(found),
        f"misses {100 * np.mean([not one.by_fixed for one in found]):.1f} %",
        None if case.least_share is None else share >= case.least_share,
    )


def _causes(case: DamageCase, found: Sequence[Found]) -> Iterator[Line]:
    """What alarms were put down to, at once and a day of running later."""
    is_film = case.kind is not DamageKind.ACCELEROMETER_GAIN
    films = (Cause.FILM, Cause.OIL, Cause.CLEARANCE)
    for key, when in (("cause", "at the alarm"), ("cause_later", "24 h later")):
        causes = Counter(getattr(one, key) for one in found if one.after_h is not None)
        said = ", ".join(f"{cause}: {causes[cause]}" for cause in Cause if causes[cause])
        yield Line(
            f"  its cause, {when}",
            "" if is_film else "never the film",
            said,
            causes.total(),
            "cannot say",
            None if is_film else not any(causes[cause] for cause in films),
        )


def _changes(changed: Sequence[Changed]) -> Line:
    factors = [max(c.factor, 1.0 / c.factor) for c in changed if np.isfinite(c.factor)]
    alarms, crossings = sum(c.alarms for c in changed), sum(c.fixed_alarms for c in changed)
    return Line(
        f"condition alone, stiffness ×{np.median(factors):.1f} or ÷{np.median(factors):.1f}",
        "0 alarms",
        f"{alarms} alarms",
        len(changed),
        f"{crossings} alarms",
        alarms == 0,
    )


def _outside(name: str, outside: Sequence[Outside]) -> Line:
    share = np.nanmean([one.no_baseline_share for one in outside])
    alarms, crossings = sum(o.alarms for o in outside), sum(o.fixed_alarms for o in outside)
    return Line(
        name,
        "0 alarms",
        f"{alarms} alarms, {100 * share:.1f} % no_baseline",
        len(outside),
        f"{crossings} alarms",
        alarms == 0,
    )
