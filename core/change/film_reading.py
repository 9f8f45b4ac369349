"""`FilmReading`: stiffness reading of one film in x and y, with its operating condition."""

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass

from core.baseline.history import DIRECTIONS, ReadingOutcome
from core.condition.cells import BearingCondition, FilmConditions
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.quality import GOOD, NOT_MEASURED, Level, Quality, Reading, Reason, worst
from core.stiffness.estimators import ESTIMATORS, reported_name


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
    ln_ck, u_ck
        Natural logarithm of damping over stiffness in s, and its random standard uncertainty.
    shaft_phase_deg, bearing_phase_deg
        Phases of the 1× motion.
    """

    ln_k: float
    u_random: float
    shaft_um_pk: float
    bearing_um_pk: float
    outcome: ReadingOutcome
    reason: Reason
    ln_ck: float = math.nan
    u_ck: float = math.nan
    shaft_phase_deg: float = math.nan
    bearing_phase_deg: float = math.nan

    @property
    def motion_um(self) -> tuple[complex, complex]:
        """1× phasors of shaft and bearing in µm; NaN if unknown."""
        return (
            cmath.rect(self.shaft_um_pk, math.radians(self.shaft_phase_deg)),
            cmath.rect(self.bearing_um_pk, math.radians(self.bearing_phase_deg)),
        )


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
    """Return the value of a reading of any quality; NaN if it has none."""
    return math.nan if reading.value is None else reading.value


def good_or_nan(reading: Reading) -> float:
    """Return the value of a reading of good quality, otherwise NaN."""
    return value_or_nan(reading) if reading.quality.level is Level.GOOD else math.nan


def _value(readings: Mapping[str, Reading], estimator: Estimator, direction: str) -> FilmValue:
    entry = ESTIMATORS[estimator]
    name = entry.stiffness.format(axes=direction * 2)
    stiffness = readings[reported_name(readings, name)]
    condition = worst(readings[key].quality for key in ("eccentricity_ratio", "oil_temperature_c"))
    outcome, reason = _outcome(stiffness, condition)
    ln_k, u_random = _ln(stiffness, outcome)
    ck = readings[entry.ck.format(axes=direction * 2)] if entry.ck else NOT_MEASURED
    ln_ck, u_ck = _ln(ck, _outcome(ck, condition)[0])
    return FilmValue(
        ln_k=ln_k,
        u_random=u_random,
        shaft_um_pk=value_or_nan(readings[f"order1_shaft_{direction}_um_pk"]),
        bearing_um_pk=value_or_nan(readings[f"order1_bearing_{direction}_um_pk"]),
        outcome=outcome,
        reason=reason,
        ln_ck=ln_ck,
        u_ck=u_ck,
        shaft_phase_deg=value_or_nan(readings[f"order1_shaft_{direction}_phase_deg"]),
        bearing_phase_deg=value_or_nan(readings[f"order1_bearing_{direction}_phase_deg"]),
    )


def _ln(reading: Reading, outcome: ReadingOutcome) -> tuple[float, float]:
    """Return ln of a measured reading and its random uncertainty, otherwise NaN."""
    if outcome is not ReadingOutcome.MEASURED:
        return math.nan, math.nan
    value = good_or_nan(reading)
    return math.log(value), (reading.u_random or 0.0) / value


def _outcome(reading: Reading, condition: Quality) -> tuple[ReadingOutcome, Reason]:
    """Return the outcome of a reading; a doubtful reading counts as bad quality."""
    quality = reading.quality
    if quality.reason is Reason.INSUFFICIENT_EXCITATION:
        return ReadingOutcome.INSUFFICIENT_EXCITATION, quality.reason
    found = quality if quality.level is not Level.GOOD else condition
    if found.level is not Level.GOOD:
        return ReadingOutcome.BAD_QUALITY, found.reason
    if not good_or_nan(reading) > 0.0 or not (reading.u_random or 0.0) > 0.0:
        return ReadingOutcome.BAD_QUALITY, Reason.OUT_OF_RANGE
    return ReadingOutcome.MEASURED, GOOD.reason
