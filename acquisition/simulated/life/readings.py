"""Readings of one bearing, made from what is true and how it is measured."""

import numpy as np

from acquisition.simulated.life.excitation import hydraulic_force_n
from acquisition.simulated.life.life_bearing import LifeBearing
from acquisition.simulated.life.life_truth import BearingLifeTruth
from acquisition.simulated.life.measured import (
    BEARING_NOISE_UM,
    OIL_RESOLUTION_C,
    SHAFT_NOISE_UM,
    U_RANDOM_KNOWN,
    Chain,
    u_random,
)
from acquisition.simulated.life.operation import Operation
from acquisition.simulated.plant.tilting_pad import FilmColumns
from core.arrays import FloatArray
from core.baseline.stiffness_history import Evidence, StiffnessHistory


def ln_stiffness(film: FilmColumns) -> FloatArray:
    """Logarithm of the direct stiffnesses, (2, n)."""
    return np.log(np.stack([film.k_xx_n_per_m, film.k_yy_n_per_m]))


def readings(
    random: np.random.Generator,
    bearing: LifeBearing,
    truth: BearingLifeTruth,
    chain: Chain,
    operation: Operation,
) -> StiffnessHistory:
    """Measure one bearing at every row; all of them are turning.

    Stiffness is measured as force over motion, k = |X_b| / |U| · k_b (Brito et al., equation 5; the
    other estimators differ in how they find the ratio), with the k_b that the monitor is told: it
    takes over whatever is wrong with accelerometer, probe or bracket.
    """
    n = len(operation)
    probe_gain = chain.probe_gain[:, np.newaxis] * truth.altered.probe_gain
    bearing_gain = chain.accelerometer_gain[:, np.newaxis] * truth.altered.accelerometer_gain
    apparent = np.log(bearing_gain / probe_gain / truth.altered.bracket)
    u = u_random(hydraulic_force_n(operation.load))
    ln_k = truth.ln_k + apparent + chain.ln_k_error
    ln_k += u * random.standard_normal((2, n))
    measured = chain.evidence == Evidence.MEASURED
    shaft_um_pk, bearing_um_pk = _amplitudes_um_pk(random, truth, chain, probe_gain, bearing_gain)
    out_of_order = chain.evidence == Evidence.BAD_QUALITY
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
        evidence=chain.evidence,
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


def _position(
    bearing: LifeBearing, truth: BearingLifeTruth, chain: Chain
) -> tuple[FloatArray, float, FloatArray]:
    """Eccentricity ratio, its standard uncertainty, attitude angle in degrees."""
    gain = chain.gap_gain[:, np.newaxis] * truth.altered.probe_gain
    x_um, y_um = gain * truth.centre_um + chain.position_error_um
    told_um = bearing.told_clearance_um
    u_ratio = float(np.std(chain.position_error_um)) / told_um
    return np.hypot(x_um, y_um) / told_um, u_ratio, np.degrees(np.arctan2(y_um, x_um))


def _oil_c(truth: BearingLifeTruth, chain: Chain) -> FloatArray:
    shown = np.round((truth.oil_temperature_c + chain.oil_error_c) / OIL_RESOLUTION_C)
    return np.asarray(shown * OIL_RESOLUTION_C)
