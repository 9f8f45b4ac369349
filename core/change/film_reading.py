"""`FilmReading`: stiffness reading of one film in x and y, with its operating condition."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from core.baseline.history import DIRECTIONS, ReadingOutcome
from core.condition.cells import BearingCondition, FilmConditions
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.quality import GOOD, Level, Quality, Reading, Reason, worst
from core.stiffness.bracket_ratio import reported_name
from core.stiffness.estimators import ESTIMATORS


@dataclass(frozen=True)
class FilmValue:
    """Stiffness reading of a film in one direction; NaN for missing values.

    Parameters
    ----------
    ln_k, u_random
        Natural logarithm of the stiffness in N/m, or of its ratio to an unknown bracket stiffness,
        and its random standard uncertainty.
    shaft_um_pk, bearing_um_pk
        1× amplitudes of the shaft relative to the bearing, and of the bearing itself.
    outcome
        Whether stiffness and film condition were measured.
    reason
        Reason for the outcome; "ok" if measured.
    """

    ln_k: float
    u_random: float
    shaft_um_pk: float
    bearing_um_pk: float
    outcome: ReadingOutcome
    reason: Reason


@dataclass(frozen=True)
class FilmReading:
    """Stiffness reading of one film in x and y, averaged over minutes; NaN for missing values.

    `time_ns` is the end of the averaged samples, ns since 1970 UTC.
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

    @property
    def conditions(self) -> FilmConditions:
        """Film conditions of this reading as columns of length 1."""
        axes = (self.eccentricity_ratio, self.oil_temperature_c, self.attitude_deg)
        return FilmConditions.one(*axes)


def film_reading(
    assessment: Assessment, condition: BearingCondition, estimator: Estimator
) -> FilmReading:
    """Return the film reading of an assessment.

    Stiffness and film conditions are NaN unless good; other values may be of any quality.
    """
    readings = assessment.readings
    eccentricity = readings["eccentricity_ratio"]
    x, y = (_value(readings, estimator, direction) for direction in DIRECTIONS)
    return FilmReading(
        unit=assessment.unit,
        bearing=assessment.bearing,
        estimator=estimator,
        time_ns=assessment.time_ns,
        condition=condition,
        speed_rpm=value_or_nan(readings["speed_rpm"]),
        power_mw=value_or_nan(readings["power_mw"]),
        eccentricity_ratio=good_or_nan(eccentricity),
        u_eccentricity=math.hypot(eccentricity.u_random or 0.0, eccentricity.u_systematic or 0.0),
        attitude_deg=good_or_nan(readings["attitude_angle_deg"]),
        oil_temperature_c=good_or_nan(readings["oil_temperature_c"]),
        values=(x, y),
    )


def value_or_nan(reading: Reading) -> float:
    """Return the value of a reading of any quality; NaN if missing."""
    return math.nan if reading.value is None else reading.value


def good_or_nan(reading: Reading) -> float:
    """Return the value of a reading of good quality, otherwise NaN."""
    return value_or_nan(reading) if reading.quality.level is Level.GOOD else math.nan


def _value(readings: Mapping[str, Reading], estimator: Estimator, direction: str) -> FilmValue:
    name = ESTIMATORS[estimator].stiffness.format(axes=direction * 2)
    stiffness = readings[reported_name(readings, name)]
    outcome, reason = _outcome(
        stiffness,
        worst(readings[key].quality for key in ("eccentricity_ratio", "oil_temperature_c")),
    )
    is_measured = outcome is ReadingOutcome.MEASURED
    k_n_per_m = good_or_nan(stiffness)
    return FilmValue(
        ln_k=math.log(k_n_per_m) if is_measured else math.nan,
        u_random=(stiffness.u_random or 0.0) / k_n_per_m if is_measured else math.nan,
        shaft_um_pk=value_or_nan(readings[f"order1_shaft_{direction}_um_pk"]),
        bearing_um_pk=value_or_nan(readings[f"order1_bearing_{direction}_um_pk"]),
        outcome=outcome,
        reason=reason,
    )


def _outcome(stiffness: Reading, condition: Quality) -> tuple[ReadingOutcome, Reason]:
    """Return the outcome of a stiffness reading; a doubtful reading counts as bad quality."""
    quality = stiffness.quality
    if quality.reason is Reason.INSUFFICIENT_EXCITATION:
        return ReadingOutcome.INSUFFICIENT_EXCITATION, quality.reason
    found = quality if quality.level is not Level.GOOD else condition
    if found.level is not Level.GOOD:
        return ReadingOutcome.BAD_QUALITY, found.reason
    if not good_or_nan(stiffness) > 0.0 or not (stiffness.u_random or 0.0) > 0.0:
        return ReadingOutcome.BAD_QUALITY, Reason.OUT_OF_RANGE
    return ReadingOutcome.MEASURED, GOOD.reason
