"""`live`: a unit's guide bearings over years, as readings with the truth beside them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from acquisition.simulated.life.columns import rows_of
from acquisition.simulated.life.condition_change import ConditionChange
from acquisition.simulated.life.damage import Alteration, Damage, alteration
from acquisition.simulated.life.films import FilmCourse, film_course
from acquisition.simulated.life.held_load import HeldLoad
from acquisition.simulated.life.inputs import BearingInputs, LifeInputs, draw_inputs
from acquisition.simulated.life.life_bearing import LIFE_BEARINGS, LifeBearing
from acquisition.simulated.life.life_truth import BearingLifeTruth, UnitLife
from acquisition.simulated.life.measured import Chain
from acquisition.simulated.life.operation import Operation
from acquisition.simulated.life.order1 import order1_um_pk, rotor_of
from acquisition.simulated.life.readings import ln_stiffness, readings
from acquisition.simulated.life.thermal import ThermalCourse
from core.arrays import ComplexArray, FloatArray


@dataclass(frozen=True, eq=False)
class _BearingLife:
    """Everything about one bearing but what the others do to it."""

    bearing: LifeBearing
    course: FilmCourse
    healthy: FilmCourse
    thermal: ThermalCourse
    altered: Alteration
    chain: Chain


def live(
    unit_seed: int,
    start_ns: int,
    years: float,
    damage: Iterable[Damage] = (),
    changes: Iterable[ConditionChange] = (),
    bearings: tuple[LifeBearing, ...] = LIFE_BEARINGS,
    held: HeldLoad | None = None,
) -> UnitLife:
    """Let one unit live, with a reading every 10 minutes while it turns.

    The same seed gives the same life; damage and changes alter nothing in it but themselves.

    Parameters
    ----------
    start_ns
        Midnight where the plant is.
    held
        By default the unit starts and stops as it will.

    Raises
    ------
    ValueError
        If years are too few or damage names an unknown bearing.
    """
    damage = tuple(damage)
    refuse_strange(damage, bearings)
    inputs = draw_inputs(unit_seed, start_ns, years, tuple(changes), bearings, held)
    return life_of(inputs, damage, inputs.operation.is_turning)


def refuse_strange(damage: tuple[Damage, ...], bearings: tuple[LifeBearing, ...]) -> None:
    """Refuse damage of bearings that are not there.

    Raises
    ------
    ValueError
        With the name.
    """
    known = {bearing.id for bearing in bearings}
    for one in damage:
        if one.bearing not in known:
            raise ValueError(f"bearing {one.bearing!r} is none of {', '.join(sorted(known))}")


def life_of(
    inputs: LifeInputs, damage: tuple[Damage, ...], turns: npt.NDArray[np.bool_]
) -> UnitLife:
    """What becomes of a life, and how it reads.

    Parameters
    ----------
    turns : (n,)
        Rows that are wanted; the shaft turns in all of them.
    """
    turning, grade_mm_s = rows_of(inputs.operation, turns), inputs.grade_mm_s[turns]
    lives = [_bearing_life(one, turns, turning, damage) for one in inputs.bearings]
    order1 = _order1(lives, turning, grade_mm_s)
    truth = {life.bearing.id: _truth(life, order1[life.bearing.id]) for life in lives}
    measured = {
        life.bearing.id: readings(
            np.random.default_rng(seed), life.bearing, truth[life.bearing.id], life.chain, turning
        )
        for life, seed in zip(lives, inputs.noise, strict=True)
    }
    return UnitLife(
        inputs.unit_seed,
        turning,
        grade_mm_s,
        inputs.water_c[turns],
        measured,
        truth,
        damage,
        inputs.changes,
    )


def _bearing_life(
    inputs: BearingInputs,
    turns: npt.NDArray[np.bool_],
    turning: Operation,
    damage: tuple[Damage, ...],
) -> _BearingLife:
    bearing, position_um = inputs.bearing, inputs.position_um[:, turns]
    thermal, chain = rows_of(inputs.thermal, turns), rows_of(inputs.chain, turns)
    altered = alteration(damage, bearing.id, turning.time_ns)
    place = bearing, inputs.setting, thermal, turning.speed_rpm, position_um
    course = healthy = film_course(*place)
    if any(one.bearing == bearing.id for one in damage):
        course = film_course(*place, altered, inputs.worn_pad)
    return _BearingLife(bearing, course, healthy, thermal, altered, chain)


def _order1(
    lives: list[_BearingLife], operation: Operation, grade_mm_s: FloatArray
) -> Mapping[str, ComplexArray]:
    return order1_um_pk(
        {life.bearing.id: life.course.film for life in lives},
        {life.bearing.id: life.altered.bracket for life in lives},
        operation.rated_speed_rpm,
        grade_mm_s,
        rotor_of(tuple(life.bearing.id for life in lives)),
    )


def _truth(life: _BearingLife, order1: ComplexArray) -> BearingLifeTruth:
    return BearingLifeTruth(
        film=life.course.film,
        ln_k=ln_stiffness(life.course.film),
        ln_k_healthy=ln_stiffness(life.healthy.film),
        clearance_um=life.course.clearance_um,
        centre_um=life.course.centre_um,
        oil_temperature_c=life.thermal.oil_temperature_c,
        order1_um_pk=order1,
        altered=life.altered,
        chain=life.chain,
    )
