"""Settings of a guide bearing."""

from typing import Annotated, Self

from pydantic import Field, StringConstraints, model_validator

from core.machine.unit import PREFERENCE, Estimator
from service.settings.alarms import BearingAlarmSettings
from service.settings.base import Identifier, MisfitError, MissingError, Settings

MicrometrePair = tuple[
    Annotated[float, Field(gt=0.0, le=10_000.0)], Annotated[float, Field(gt=0.0, le=10_000.0)]
]

CHANNEL_KEYS = ("shaft_x", "shaft_y", "bearing_x", "bearing_y")
"""Required keys of a bearing whose values are ids of waveform channels."""

OPTIONAL_CHANNEL_KEYS = ("opposite_x", "opposite_y")
"""Optional keys of a bearing whose values are ids of waveform channels."""

GAP_KEYS = ("gap_x", "gap_y", "opposite_gap_x", "opposite_gap_y")
"""Keys of a bearing whose values are ids of slow channels of gaps."""


OF_KNOWN_BRACKETS = {
    *("bracket_stiffness_uncertainty", "bracket_mass_kg", "bracket_mass_uncertainty"),
    "bracket_damping_n_s_per_m",
}
"""Keys of a bearing that require the stiffness of its bracket."""


class BearingSettings(Settings):
    """Settings of a guide bearing: bracket, clearance, channels and alarm limits."""

    id: Identifier
    """Id of the bearing, unique within the unit; example: "UJB", "LJB", "TJB" for upper, lower and
    turbine journal bearing."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=80)] | None = None
    """Display name of the bearing beside its id; none by default; example: "upper guide"."""

    bracket_stiffness_n_per_m: Annotated[float, Field(ge=1e7, le=1e12)] | None = None
    """Radial stiffness of the bracket in N/m, between 1e7 and 1e12; example: 1.18e9. Every film
    coefficient is proportional to the bracket stiffness. If it is unknown, leave it out: films are
    then reported, and compared with their baselines, as ratios to it. A baseline that was learned
    before the stiffness was given or left out must be renewed."""

    clearance_um: Annotated[float, Field(ge=20.0, le=5000.0)]
    """Radial clearance in operation in µm, 20 to 5000; example: 200.0."""

    gap_reference_um: MicrometrePair
    """Probe gaps [x, y] in µm with the shaft centred; example: [2000.0, 1950.0]."""

    shaft_x: Identifier
    """Channel of the shaft's relative vibration in x."""

    shaft_y: Identifier
    """Channel of the shaft's relative vibration in y."""

    bearing_x: Identifier
    """Channel of the bearing's absolute vibration in x."""

    bearing_y: Identifier
    """Channel of the bearing's absolute vibration in y."""

    oil_temperature: Identifier | None = None
    """Slow channel (degC) of the oil temperature; none by default."""

    gap_x: Identifier | None = None
    """Slow channel (mm) of the gap in x; by default the gap is the mean of the proximity probe
    shaft_x. Example: "ujb_gap_x"."""

    gap_y: Identifier | None = None
    """Slow channel (mm) of the gap in y, as gap_x; example: "ujb_gap_y"."""

    opposite_x: Identifier | None = None
    """Channel of the proximity probe opposite to shaft_x. The two probes together separate shaft
    position from thermal growth; none by default. Example: "ujb_shaft_minus_x"."""

    opposite_y: Identifier | None = None
    """Channel of the proximity probe opposite to shaft_y; example: "ujb_shaft_minus_y"."""

    opposite_gap_x: Identifier | None = None
    """Slow channel (mm) of the gap opposite to x; by default the gap is the mean of opposite_x.
    Example: "ujb_gap_minus_x"."""

    opposite_gap_y: Identifier | None = None
    """Slow channel (mm) of the gap opposite to y, as opposite_gap_x; example:
    "ujb_gap_minus_y"."""

    opposite_reference_um: MicrometrePair | None = None
    """Gaps [x, y] in µm of the opposite probes with the shaft centred; example:
    [1980.0, 2010.0]."""

    gap_reference_uncertainty_um: Annotated[float, Field(ge=0.0, le=1000.0)] = 5.0
    """Half-width of the error interval of the reference gaps, µm."""

    thermal_growth_um: Annotated[float, Field(ge=0.0, le=5000.0)] = 50.0
    """Half-width of the interval of the common thermal growth of all gaps since the reference gaps
    were measured, µm; used without opposite probes."""

    thermal_growth_change_um: Annotated[float, Field(ge=0.0, le=5000.0)] = 20.0
    """Half-width of the interval of the change of thermal growth since the last measurement with
    opposite probes, µm."""

    clearance_uncertainty: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.05
    """Half-width of the relative error interval of the clearance."""

    bracket_stiffness_uncertainty: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.10
    """Half-width of the relative error interval of the bracket's stiffness; example: 0.10."""

    bracket_mass_kg: Annotated[float, Field(gt=0.0, le=1e7)] | None = None
    """Effective mass of bracket and bearing, kg; by default the estimator "dynamic" fits the mass
    together with the film coefficients, with a larger uncertainty. Equation (5) does not use the
    mass. Example: 45.0e3."""

    bracket_mass_uncertainty: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.2
    """Half-width of the relative error interval of bracket_mass_kg; example: 0.2."""

    bracket_damping_n_s_per_m: Annotated[float, Field(ge=0.0, le=1e10)] = 0.0
    """Damping of the bracket in N·s/m; 0 if unknown."""

    bracket_damping_uncertainty: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.02
    """Half-width of the error interval of the bracket's damping, as a share of critical damping;
    example: 0.02."""

    cross_coupling_uncertainty: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.3
    """Half-width of the interval, around 0, of the ratio of cross-coupled to direct film stiffness.
    The transfer estimators and equation (5) neglect the cross-coupled stiffness. Example: 0.3."""

    delay_uncertainty_s: Annotated[float, Field(ge=0.0, le=0.1)] = 2e-4
    """Half-width of the interval of the unknown delay of the bearing channels relative to the shaft
    channels, s; known delays are set by delay_s of a channel. Example: 0.0002."""

    runout_um_pk: Annotated[float, Field(ge=0.0, le=1000.0)] = 6.0
    """Maximum runout of the shaft surface at 1×, µm zero-to-peak. The runout increases the
    uncertainty of the 1× vector; no stiffness is computed from shaft motion below four times the
    runout. Example: 10.0."""

    preference: Annotated[tuple[Estimator, ...], Field(min_length=1, max_length=5)] = PREFERENCE
    """Order of preference of the stiffness estimators for trends and alarms: "dynamic",
    "transfer_vortex", "transfer_order1", "ratio_vortex", "ratio_order1". Of the estimators with the
    best quality, the first is used."""

    watched_estimator: Estimator | None = None
    """Estimator whose stiffness is compared with its baseline; by default the first of preference,
    or "ratio_order1" for a rack with amplitudes. A different estimator requires a new baseline."""

    alarms: BearingAlarmSettings = BearingAlarmSettings()
    """Alarm limits of the bearing; none by default."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        has_probes, key = bool(self.opposite_x or self.opposite_y), "opposite_reference_um"
        if has_probes and self.opposite_reference_um is None:
            raise MissingError("is missing; opposite_x and opposite_y require it", key)
        if not has_probes and self.opposite_reference_um is not None:
            raise MisfitError("applies only with opposite_x or opposite_y; remove it", key)
        if self.bracket_stiffness_n_per_m is None:
            for key in OF_KNOWN_BRACKETS & self.model_fields_set:
                raise MisfitError("applies only with bracket_stiffness_n_per_m; remove it", key)
        if self.alarms.oil_temperature_c is not None and self.oil_temperature is None:
            raise MisfitError(
                "requires oil_temperature, the slow channel of the bearing's oil temperature",
                *("alarms", "oil_temperature_c"),
            )
        return self
