"""Simulation of years of stiffness readings of a unit, together with the true state."""

import copy
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from acquisition.simulated.life.bearing import LIFE_BEARINGS, LifeBearing, ThermalCourse
from acquisition.simulated.life.damage import Alteration, Damage, alteration
from acquisition.simulated.life.excitation import hydraulic_force_n, order1_um_pk, rotor_of
from acquisition.simulated.life.films import FilmCourse, film_course, rows_of
from acquisition.simulated.life.inputs import BearingInputs, LifeInputs, draw_inputs
from acquisition.simulated.life.operation import HeldLoad, Operation
from acquisition.simulated.life.shaft import ConditionChange
from acquisition.simulated.life.truth import (
    BEARING_NOISE_UM,
    CK_CORRELATION,
    CK_SHARE,
    OIL_RESOLUTION_C,
    SHAFT_NOISE_UM,
    U_RANDOM_KNOWN,
    BearingLifeTruth,
    Chain,
    UnitLife,
    u_random,
)
from acquisition.simulated.plant.films import FilmColumns
from core.arrays import ComplexArray, FloatArray
from core.baseline.history import ReadingOutcome, StiffnessHistory


def _ln_stiffness(film: FilmColumns) -> FloatArray:
    """Return the natural logarithm of the direct stiffness in x and y, in N/m, (2, n)."""
    return np.log(np.stack([film.k_xx_n_per_m, film.k_yy_n_per_m]))


def _ln_damping_over_stiffness(film: FilmColumns) -> FloatArray:
    """Return the natural logarithm of direct damping over stiffness in x and y, in s, (2, n)."""
    return np.log(film.c_n_s_per_m[[0, 2]]) - _ln_stiffness(film)


def readings(
    random: np.random.Generator,
    bearing: LifeBearing,
    truth: BearingLifeTruth,
    chain: Chain,
    operation: Operation,
) -> StiffnessHistory:
    """Return the simulated readings of one bearing at all rows of `operation`.

    The shaft must turn at all rows. Stiffness is force divided by motion, k = |X_b| / |U| · k_b
    with bracket motion X_b, film motion U and the configured bracket stiffness k_b (Brito et al.,
    equation 5; other estimators compute the ratio differently). Errors of accelerometer, probe and
    bracket stiffness therefore affect it. They cancel in damping over stiffness.
    """
    n = len(operation)
    probe_gain = chain.probe_gain[:, np.newaxis] * truth.altered.probe_gain
    bearing_gain = chain.accelerometer_gain[:, np.newaxis] * truth.altered.accelerometer_gain
    apparent = np.log(bearing_gain / probe_gain / truth.altered.bracket)
    u = u_random(hydraulic_force_n(operation.load))
    ln_k = truth.ln_k + apparent + chain.ln_k_error
    error = random.standard_normal((2, n))
    ln_k += u * error
    # its own stream, so that the other readings are those of a life without damping
    of_ck, u_ck = random.spawn(1)[0], CK_SHARE * u
    own = math.sqrt(1.0 - CK_CORRELATION**2) * of_ck.standard_normal((2, n))
    ln_ck = truth.ln_ck + chain.ln_ck_error + u_ck * (CK_CORRELATION * error + own)
    measured = chain.evidence == ReadingOutcome.MEASURED
    shaft_um_pk, bearing_um_pk = _amplitudes_um_pk(random, truth, chain, probe_gain, bearing_gain)
    shaft_deg, bearing_deg = _phases_deg(of_ck, truth, chain)
    out_of_order = chain.evidence == ReadingOutcome.BAD_QUALITY
    ratio, u_ratio, attitude_deg = _position(bearing, truth, chain)
    return StiffnessHistory(
        time_ns=operation.time_ns,
        speed_rpm=operation.speed_rpm,
        power_mw=operation.power_mw,
        eccentricity_ratio=ratio,
        u_eccentricity=np.full(n, u_ratio),
        attitude_deg=attitude_deg,
        oil_temperature_c=_oil_c(truth, chain),
        ln_k=np.where(measured, ln_k, np.nan),
        u_random=np.where(measured, u * _known(random, n), np.nan),
        shaft_um_pk=np.where(out_of_order, np.nan, shaft_um_pk),
        bearing_um_pk=np.where(out_of_order, np.nan, bearing_um_pk),
        outcome=chain.evidence,
        ln_ck=np.where(measured, ln_ck, np.nan),
        u_ck=np.where(measured, u_ck * _known(of_ck, n), np.nan),
        shaft_phase_deg=np.where(out_of_order, np.nan, shaft_deg),
        bearing_phase_deg=np.where(out_of_order, np.nan, bearing_deg),
    )


def _known(random: np.random.Generator, n: int) -> FloatArray:
    return np.exp(U_RANDOM_KNOWN * random.standard_normal((2, n)))


def _amplitudes_um_pk(
    random: np.random.Generator,
    truth: BearingLifeTruth,
    chain: Chain,
    probe_gain: FloatArray,
    bearing_gain: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    relative, bearing = truth.order1_um_pk[:2], truth.order1_um_pk[2:]
    shaft_um_pk = probe_gain * np.abs(relative + chain.runout_um_pk[:, np.newaxis])
    bearing_um_pk = bearing_gain * np.abs(bearing)
    shaft_um_pk += SHAFT_NOISE_UM * random.standard_normal(shaft_um_pk.shape)
    bearing_um_pk += BEARING_NOISE_UM * random.standard_normal(bearing_um_pk.shape)
    return np.abs(shaft_um_pk), np.abs(bearing_um_pk)


def _phases_deg(
    random: np.random.Generator, truth: BearingLifeTruth, chain: Chain
) -> tuple[FloatArray, FloatArray]:
    """Return the phases of the 1× motion of shaft and bearing, (2, n) each."""
    shaft = truth.order1_um_pk[:2] + chain.runout_um_pk[:, np.newaxis]
    bearing = truth.order1_um_pk[2:]
    noise = ((shaft, SHAFT_NOISE_UM), (bearing, BEARING_NOISE_UM))
    shaft_rad, bearing_rad = (
        np.angle(phasor) + um / np.abs(phasor) * random.standard_normal(phasor.shape)
        for phasor, um in noise
    )
    return np.degrees(shaft_rad), np.degrees(bearing_rad)


def _position(
    bearing: LifeBearing, truth: BearingLifeTruth, chain: Chain
) -> tuple[FloatArray, float, FloatArray]:
    """Return eccentricity ratio, its standard uncertainty, and attitude angle in degrees."""
    gain = chain.gap_gain[:, np.newaxis] * truth.altered.probe_gain
    x_um, y_um = gain * truth.centre_um + chain.position_error_um
    told_um = bearing.configured_clearance_um
    u_ratio = float(np.std(chain.position_error_um)) / told_um
    return np.hypot(x_um, y_um) / told_um, u_ratio, np.degrees(np.arctan2(y_um, x_um))


def _oil_c(truth: BearingLifeTruth, chain: Chain) -> FloatArray:
    shown = np.round((truth.oil_temperature_c + chain.oil_error_c) / OIL_RESOLUTION_C)
    return np.asarray(shown * OIL_RESOLUTION_C)


@dataclass(frozen=True, eq=False)
class _BearingLife:
    """True state of one bearing over time, before the coupled response at 1× is computed."""

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
    """Simulate the life of one unit, with one reading every 10 minutes while the shaft turns.

    The same seed gives the same life; damage and changes do not affect its random numbers.

    Parameters
    ----------
    start_ns
        Time of the first row: midnight in the time zone of the plant.
    held
        Operation at constant load; None for random starts and stops.

    Raises
    ------
    ValueError
        If `years` is less than a day, the unit never turns, or damage has an unknown bearing.
    """
    damage = tuple(damage)
    require_known_bearings(damage, bearings)
    inputs = draw_inputs(unit_seed, start_ns, years, tuple(changes), bearings, held)
    return life_of(inputs, damage, inputs.operation.is_turning)


def require_known_bearings(damage: tuple[Damage, ...], bearings: tuple[LifeBearing, ...]) -> None:
    """Check that the bearings of all damage are known; raise `ValueError` for an unknown id."""
    known = {bearing.id for bearing in bearings}
    for one in damage:
        if one.bearing not in known:
            raise ValueError(f"unknown bearing {one.bearing!r}; known: {', '.join(sorted(known))}")


def life_of(
    inputs: LifeInputs, damage: tuple[Damage, ...], turns: npt.NDArray[np.bool_]
) -> UnitLife:
    """Return the true state and the readings of the life with the given inputs and damage.

    `turns` (n,) is the mask of the selected rows, at which the shaft must turn.
    """
    turning, grade_mm_s = rows_of(inputs.operation, turns), inputs.grade_mm_s[turns]
    lives = [_bearing_life(one, turns, turning, damage) for one in inputs.bearings]
    order1 = _order1(lives, turning, grade_mm_s)
    truth = {life.bearing.id: _truth(life, order1[life.bearing.id]) for life in lives}
    # a seed counts the streams spawned from it; a copy gives the same streams each time
    noise = map(np.random.default_rng, copy.deepcopy(inputs.noise))
    measured = {
        life.bearing.id: readings(random, life.bearing, truth[life.bearing.id], life.chain, turning)
        for life, random in zip(lives, noise, strict=True)
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
        ln_k=_ln_stiffness(life.course.film),
        ln_k_healthy=_ln_stiffness(life.healthy.film),
        ln_ck=_ln_damping_over_stiffness(life.course.film),
        clearance_um=life.course.clearance_um,
        centre_um=life.course.centre_um,
        oil_temperature_c=life.thermal.oil_temperature_c,
        order1_um_pk=order1,
        altered=life.altered,
        chain=life.chain,
    )
