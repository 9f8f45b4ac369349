"""What is really so in a simulated unit: the answers a monitor should find."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from acquisition.simulated.plant.conditions import Conditions
from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.scenario import Scenario
from core.machine.unit import Unit
from core.units import rad_s_from_rpm


@dataclass(frozen=True)
class BearingTruth:
    """One bearing.

    Parameters
    ----------
    k_eff_xx_n_per_m, k_eff_yy_n_per_m
        ``|k + iΩc|`` at the running speed, which equation (5) of Brito et al. estimates.
    eccentricity
        Distance of the shaft centre from the bearing centre over the clearance.
    gap_growth_um
        What all gaps of the bearing have in common.
    bracket_stiffness_n_per_m
        Of the bracket as it is, not as the monitor is told.
    """

    film: Film
    k_eff_xx_n_per_m: float
    k_eff_yy_n_per_m: float
    centre_x_um: float
    centre_y_um: float
    eccentricity: float
    oil_temperature_c: float
    gap_growth_um: float
    bracket_stiffness_n_per_m: float


@dataclass(frozen=True)
class UnitTruth:
    """A unit at one instant."""

    speed_rpm: float
    active_power_mw: float
    bearings: Mapping[str, BearingTruth]


def unit_truth(machine: Unit, scenario: Scenario, now: Conditions, speed_rpm: float) -> UnitTruth:
    """Gather what is so at one instant."""
    brackets = {b.bearing: b.stiffness_n_per_m for b in scenario.true_rotor.brackets}
    bearings = {}
    for index, bearing in enumerate(machine.bearings):
        film = scenario.bearings[bearing.id].film
        k_eff = film.effective_stiffness_n_per_m(rad_s_from_rpm(speed_rpm))
        centre_x_um, centre_y_um = (float(c) for c in now.centre_um[index])
        bearings[bearing.id] = BearingTruth(
            film=film,
            k_eff_xx_n_per_m=k_eff[0],
            k_eff_yy_n_per_m=k_eff[1],
            centre_x_um=centre_x_um,
            centre_y_um=centre_y_um,
            eccentricity=math.hypot(centre_x_um, centre_y_um) / bearing.clearance_um,
            oil_temperature_c=float(now.oil_temperature_c[index]),
            gap_growth_um=float(now.gap_growth_um[index]),
            bracket_stiffness_n_per_m=brackets[bearing.id],
        )
    return UnitTruth(speed_rpm, now.active_power_mw, bearings)
