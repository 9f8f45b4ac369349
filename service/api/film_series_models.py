"""What the API answers about the readings of a film, by column."""

from typing import Literal

from service.api.film_models import LevelHeldName, OperatingStateName, VerdictName
from service.api.models import ApiModel, EstimatorName, Time

EvidenceName = Literal["measured", "insufficient_excitation", "bad_quality"]

ProvenanceName = Literal["measured", "simulated"]


class FilmSeriesModel(ApiModel):
    """What was read of a film in one direction; a value for each time, null without a number."""

    stiffness_n_per_m: list[float | None]
    """Stiffness by the watched estimator."""

    u_random_n_per_m: list[float | None]
    """Its random standard uncertainty."""

    shaft_um_pk: list[float | None]
    """Shaft motion relative to the bearing at 1×, zero to peak."""

    bearing_um_pk: list[float | None]
    """Bearing motion at 1×, zero to peak."""

    evidence: list[EvidenceName]
    """Whether stiffness was measured, and if not, why there is no number."""

    verdict: list[VerdictName]
    """What was said of it when it came in."""

    level: list[LevelHeldName | None]
    """Level that was held then."""

    change_percent: list[float | None]
    """Most significant mean change of stiffness then, %."""

    deviation_percent: list[float | None]
    """Deviation of the reading alone, %; null unless it was compared."""


class FilmReadingsModel(ApiModel):
    """Readings of a film with the conditions that they were taken under, oldest first."""

    unit: str
    """Unit."""

    bearing: str
    """Bearing."""

    estimator: EstimatorName
    """Whose stiffness it is."""

    start: Time
    """First time asked for."""

    end: Time
    """Time up to which was asked."""

    n_found: int
    """Readings in this range that fit; more than are given here if they were thinned."""

    next_end: Time | None
    """When not thinned: what to give as ``end`` for those that are older; null if there are
    none."""

    time: list[float]
    """Seconds since 1970 UTC."""

    provenance: list[ProvenanceName]
    """Whether a reading was measured on the machine, or simulated without samples."""

    operating_state: list[OperatingStateName]
    """What the unit did."""

    is_settled: list[bool]
    """Whether it had done so long enough for films to be compared."""

    speed_rpm: list[float | None]
    """Speed, r/min."""

    power_mw: list[float | None]
    """Active power, MW."""

    eccentricity_ratio: list[float | None]
    """Distance of the shaft from the bearing's centre over the clearance."""

    attitude_deg: list[float | None]
    """Attitude angle, degrees."""

    oil_temperature_c: list[float | None]
    """Oil temperature, °C."""

    baseline_version: list[int | None]
    """What it was compared with; null where nothing was in force."""

    x: FilmSeriesModel
    """In x."""

    y: FilmSeriesModel
    """In y."""
