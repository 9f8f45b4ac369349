"""`live`: a unit's guide bearings over years, as readings with the truth beside them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from acquisition.simulated.life.columns import rows_of
from acquisition.simulated.life.condition_change import ConditionChange
from acquisition.simulated.life.damage import Alteration, Damage, alteration
from acquisition.simulated.life.excitation import draw_grade_mm_s
from acquisition.simulated.life.films import FilmCourse, PadSetting, draw_setting, film_course
from acquisition.simulated.life.life_bearing import LIFE_BEARINGS, LifeBearing
from acquisition.simulated.life.life_truth import BearingLifeTruth, UnitLife
from acquisition.simulated.life.measured import Chain, draw_chain
from acquisition.simulated.life.operation import Operation, time_grid_ns
from acquisition.simulated.life.order1 import order1_um_pk
from acquisition.simulated.life.readings import ln_stiffness, readings
from acquisition.simulated.life.schedule import draw_operation
from acquisition.simulated.life.shaft_position import draw_positions_um
from acquisition.simulated.life.thermal import (
    ThermalCourse,
    draw_closing_share,
    draw_water_c,
    thermal_course,
)
from core.arrays import ComplexArray, FloatArray
from core.rotor_parameters import RotorParameters

RATED_SPEEDS_RPM = (92.3, 90.9)
"""Of the units for 60 Hz and for 50 Hz (Brito et al., section 1): even and odd seeds."""


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
) -> UnitLife:
    """Let one unit live, with a reading every 10 minutes while it turns.

    The same seed gives the same life; damage and changes alter nothing in it but themselves.

    Parameters
    ----------
    start_ns
        Midnight where the plant is.

    Raises
    ------
    ValueError
        If years are too few or damage names an unknown bearing.
    """
    damage, changes = tuple(damage), tuple(changes)
    _check(damage, bearings)
    random = _Streams(unit_seed, len(bearings))
    time_ns = time_grid_ns(start_ns, years)
    operation = draw_operation(random.operation, time_ns, RATED_SPEEDS_RPM[unit_seed % 2])
    water_c = draw_water_c(random.water, operation)
    positions_um = draw_positions_um(random.position, operation, bearings, changes)
    grade_mm_s = draw_grade_mm_s(random.unbalance, operation)
    turns = operation.is_turning
    if not turns.any():
        raise ValueError(f"unit {unit_seed} never turns in {years} years")
    oil_offset_c = _oil_offset_c(operation, changes)
    turning = rows_of(operation, turns)
    lives = [
        _bearing_life(
            bearing,
            draw_setting(setting, bearing),
            rows_of(_thermal(setting, bearing, operation, water_c, oil_offset_c), turns),
            rows_of(draw_chain(chain, operation), turns),
            positions_um[bearing.id][:, turns],
            turning,
            damage,
        )
        for bearing, setting, chain in zip(bearings, random.settings, random.chains, strict=True)
    ]
    order1 = _order1(lives, turning, grade_mm_s[turns])
    truth = {life.bearing.id: _truth(life, order1[life.bearing.id]) for life in lives}
    measured = {
        life.bearing.id: readings(noise, life.bearing, truth[life.bearing.id], life.chain, turning)
        for life, noise in zip(lives, random.noises, strict=True)
    }
    return UnitLife(
        unit_seed, turning, grade_mm_s[turns], water_c[turns], measured, truth, damage, changes
    )


class _Streams:
    """Independent randomness for every subject, so that none shifts another."""

    def __init__(self, unit_seed: int, n_bearings: int) -> None:
        plant, *own = np.random.SeedSequence(unit_seed).spawn(1 + 3 * n_bearings)
        self.operation, self.water, self.position, self.unbalance = (
            np.random.default_rng(seed) for seed in plant.spawn(4)
        )
        generators = [np.random.default_rng(seed) for seed in own]
        self.settings, self.chains, self.noises = (generators[i::3] for i in range(3))


def _check(damage: tuple[Damage, ...], bearings: tuple[LifeBearing, ...]) -> None:
    known = {bearing.id for bearing in bearings}
    for one in damage:
        if one.bearing not in known:
            raise ValueError(f"bearing {one.bearing!r} is none of {', '.join(sorted(known))}")


def _oil_offset_c(operation: Operation, changes: tuple[ConditionChange, ...]) -> FloatArray:
    offset_c = np.zeros(len(operation))
    for change in changes:
        offset_c += change.oil_offset_c * change.holds(operation.time_ns)
    return offset_c


def _thermal(
    random: np.random.Generator,
    bearing: LifeBearing,
    operation: Operation,
    water_c: FloatArray,
    oil_offset_c: FloatArray,
) -> ThermalCourse:
    closing_share = draw_closing_share(random, operation)
    return thermal_course(bearing, operation, water_c, closing_share, oil_offset_c)


def _bearing_life(
    bearing: LifeBearing,
    setting: PadSetting,
    thermal: ThermalCourse,
    chain: Chain,
    position_um: FloatArray,
    operation: Operation,
    damage: tuple[Damage, ...],
) -> _BearingLife:
    speed_rpm = operation.speed_rpm
    altered = alteration(damage, bearing.id, operation.time_ns)
    healthy = film_course(bearing, setting, thermal, speed_rpm, position_um)
    course = healthy
    if any(one.bearing == bearing.id for one in damage):
        course = film_course(bearing, setting, thermal, speed_rpm, position_um, altered)
    return _BearingLife(bearing, course, healthy, thermal, altered, chain)


def _order1(
    lives: list[_BearingLife], operation: Operation, grade_mm_s: FloatArray
) -> Mapping[str, ComplexArray]:
    return order1_um_pk(
        {life.bearing.id: life.course.film for life in lives},
        {life.bearing.id: life.altered.bracket for life in lives},
        operation.rated_speed_rpm,
        grade_mm_s,
        _rotor(lives),
    )


def _rotor(lives: list[_BearingLife]) -> RotorParameters:
    """The paper's rotor on the brackets that the unit has."""
    rotor = RotorParameters()
    ids = [life.bearing.id for life in lives]
    return replace(rotor, brackets=tuple(b for b in rotor.brackets if b.bearing in ids))


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
