"""A life around the present: its readings until now, and its course from now on.

Both are of the same life, so that samples at 600 Hz go on where readings stop. It counts from the
first of January of last year, until two years later, whenever it is asked for: a unit that is
watched again tomorrow has the same past.
"""

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from acquisition.simulated.life.damage import Damage
from acquisition.simulated.life.held_load import HeldLoad
from acquisition.simulated.life.inputs import LifeInputs, draw_inputs
from acquisition.simulated.life.life import life_of, refuse_strange
from acquisition.simulated.life.life_bearing import LIFE_BEARINGS
from acquisition.simulated.life.life_course import LifeCourse
from acquisition.simulated.life.life_truth import UnitLife
from acquisition.simulated.life.moment import TRANSDUCER_NOISE
from acquisition.simulated.life.schedule import YEAR_DAYS
from acquisition.simulated.plant.scenario import TransducerNoise
from core.machine.unit import Unit
from core.units import NS_PER_S, ns_from_s

YEARS = 3.0
"""Last year, this one and the next."""

DAY_NS = 86_400 * NS_PER_S


@dataclass(frozen=True)
class LifePlan:
    """Which life a unit lives, and what comes to it.

    Parameters
    ----------
    seed
        Even: of a unit of 92.3 r/min, odd: of 90.9 r/min.
    held_load
        Share of rated power at which the unit is kept running from the beginning of yesterday on,
        by UTC; None lets it start and stop as it will.
    """

    seed: int
    held_load: float | None = None
    damage: tuple[Damage, ...] = ()


def history_until(plan: LifePlan, now_ns: int, years: float = 1.0) -> UnitLife:
    """Readings of a life until now, with the truth beside them.

    Parameters
    ----------
    years
        How far back; a year is always there.

    Raises
    ------
    ValueError
        If the life does not reach so far back, or damage names an unknown bearing.
    """
    refuse_strange(plan.damage, LIFE_BEARINGS)
    inputs = _inputs(plan, now_ns)
    time_ns, from_ns = inputs.operation.time_ns, now_ns - ns_from_s(years * YEAR_DAYS * 86_400.0)
    if from_ns < time_ns[0] - DAY_NS:
        raise ValueError(f"years = {years:g} reach back beyond the life of unit {plan.seed}")
    wanted = inputs.operation.is_turning & (time_ns >= from_ns) & (time_ns < now_ns)
    return life_of(inputs, plan.damage, np.asarray(wanted))


def course_from(
    plan: LifePlan, now_ns: int, machine: Unit, noise: TransducerNoise = TRANSDUCER_NOISE
) -> LifeCourse:
    """Course of the same life from now on; it ends with next year.

    Raises
    ------
    ValueError
        If damage names an unknown bearing.
    KeyError
        If the machine has a bearing that the life has not.
    """
    return LifeCourse(_inputs(plan, now_ns), plan.damage, machine, now_ns, noise)


def _inputs(plan: LifePlan, now_ns: int) -> LifeInputs:
    held = None
    if plan.held_load is not None:
        held = HeldLoad((now_ns // DAY_NS - 1) * DAY_NS, plan.held_load)
    return draw_inputs(plan.seed, _last_new_year_ns(now_ns), YEARS, held=held)


def _last_new_year_ns(now_ns: int) -> int:
    """The first of January of last year."""
    year = datetime.fromtimestamp(now_ns // NS_PER_S, UTC).year - 1
    return int(datetime(year, 1, 1, tzinfo=UTC).timestamp()) * NS_PER_S
