"""`FilmReading`: one reading of one film with the condition that it was taken under."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from core.baseline.stiffness_history import DIRECTIONS, Evidence
from core.condition.cells import BearingCondition
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.quality import GOOD, Level, Quality, Reading, Reason, worst
from core.stiffness.estimators import ESTIMATORS


@dataclass(frozen=True)
class FilmValue:
    """What was read of a film in one direction; NaN where there is no number.

    Parameters
    ----------
    ln_k, u_random
        Natural logarithm of the stiffness in N/m, and its random standard uncertainty.
    shaft_um_pk, bearing_um_pk
        1× amplitudes of shaft relative to bearing, and of bearing.
    evidence, reason
        Whether stiffness and condition were measured, and if not, why.
    """

    ln_k: float
    u_random: float
    shaft_um_pk: float
    bearing_um_pk: float
    evidence: Evidence
    reason: Reason


@dataclass(frozen=True)
class FilmReading:
    """One film at one moment, averaged over a few minutes; NaN where there is no number.

    Parameters
    ----------
    estimator
        Where the stiffness comes from.
    values
        In x and in y.
    """

    unit: str
    bearing: str
    estimator: Estimator
    time_ns: int
    condition: BearingCondition
    speed_rpm: float
    power_mw: float
    eccentricity_ratio: float
    u_eccentricity: float
    attitude_deg: float
    oil_temperature_c: float
    values: tuple[FilmValue, FilmValue]


def film_reading(
    assessment: Assessment, condition: BearingCondition, estimator: Estimator
) -> FilmReading:
    """Read a film off an assessment; only numbers without any doubt are taken as numbers."""
    readings = assessment.readings
    eccentricity = readings["eccentricity_ratio"]
    x, y = (_value(readings, estimator, direction) for direction in DIRECTIONS)
    return FilmReading(
        unit=assessment.unit,
        bearing=assessment.bearing,
        estimator=estimator,
        time_ns=assessment.time_ns,
        condition=condition,
        speed_rpm=shown(readings["speed_rpm"]),
        power_mw=shown(readings["power_mw"]),
        eccentricity_ratio=sure(eccentricity),
        u_eccentricity=math.hypot(eccentricity.u_random or 0.0, eccentricity.u_systematic or 0.0),
        attitude_deg=sure(readings["attitude_angle_deg"]),
        oil_temperature_c=sure(readings["oil_temperature_c"]),
        values=(x, y),
    )


def shown(reading: Reading) -> float:
    """Number of a reading, doubted or not."""
    return math.nan if reading.value is None else reading.value


def sure(reading: Reading) -> float:
    """Number of a reading that nothing casts doubt on."""
    return shown(reading) if reading.quality.level is Level.GOOD else math.nan


def _value(readings: Mapping[str, Reading], estimator: Estimator, direction: str) -> FilmValue:
    stiffness = readings[ESTIMATORS[estimator].stiffness.format(axes=direction * 2)]
    evidence, reason = _judged(stiffness, _condition_quality(readings))
    is_measured = evidence is Evidence.MEASURED
    k_n_per_m = sure(stiffness)
    return FilmValue(
        ln_k=math.log(k_n_per_m) if is_measured else math.nan,
        u_random=(stiffness.u_random or 0.0) / k_n_per_m if is_measured else math.nan,
        shaft_um_pk=shown(readings[f"order1_shaft_{direction}_um_pk"]),
        bearing_um_pk=shown(readings[f"order1_bearing_{direction}_um_pk"]),
        evidence=evidence,
        reason=reason,
    )


def _condition_quality(readings: Mapping[str, Reading]) -> Quality:
    return worst(readings[name].quality for name in ("eccentricity_ratio", "oil_temperature_c"))


def _judged(stiffness: Reading, condition: Quality) -> tuple[Evidence, Reason]:
    """What a stiffness is worth: silence rather than a number that is doubted."""
    quality = stiffness.quality
    if quality.reason is Reason.INSUFFICIENT_EXCITATION:
        return Evidence.INSUFFICIENT_EXCITATION, quality.reason
    found = quality if quality.level is not Level.GOOD else condition
    if found.level is not Level.GOOD:
        return Evidence.BAD_QUALITY, found.reason
    if not sure(stiffness) > 0.0 or not (stiffness.u_random or 0.0) > 0.0:
        return Evidence.BAD_QUALITY, Reason.OUT_OF_RANGE
    return Evidence.MEASURED, GOOD.reason
