"""The simulated machines behind simulated sources and DAQs."""

from acquisition.clock import Clock
from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.scenario import (
    BearingScenario,
    HydraulicNoise,
    Scenario,
    TransducerNoise,
    VortexRope,
)
from acquisition.simulated.plant.unit import SimulatedUnit
from service.measuring.simulated_lives import course_of_life
from service.settings.core_values import calibration_of, machine_of
from service.settings.sources.simulated import SimulatedBearingSettings, SimulationSettings
from service.settings.units import UnitSettings


def simulated_feed(unit: UnitSettings, clock: Clock) -> SimulatedUnit:
    """The simulated machine of a unit, its first sample now.

    Raises
    ------
    LookupError
        If the unit has none.
    ConfigError
        If the unit cannot have the life that it is to live.
    """
    simulation, now_ns = simulation_of(unit), clock.now_ns()
    lives = simulation.life_seed is not None
    scenario = course_of_life(unit, simulation, now_ns) if lives else scenario_of(simulation)
    machine, calibration = machine_of(unit), calibration_of(unit)
    return SimulatedUnit(machine, calibration, scenario, simulation.seed, now_ns)


def scenario_of(simulation: SimulationSettings) -> Scenario:
    """What a simulated unit with fixed films goes through.

    Raises
    ------
    LookupError
        If it has a life instead.
    """
    if simulation.speed_rpm is None or simulation.power_mw is None:
        raise LookupError("a simulated unit with a life has no fixed scenario")
    return Scenario(
        bearings={bearing.bearing: _bearing_scenario(bearing) for bearing in simulation.bearing},
        speed_rpm=simulation.speed_rpm,
        active_power_mw=simulation.power_mw,
        active_power_wander_mw_rms=simulation.power_wander_mw_rms,
        unbalance_grade_mm_s=simulation.unbalance_grade_mm_s,
        hydraulic=HydraulicNoise(simulation.hydraulic_force_n_rms, simulation.hydraulic_cutoff_hz),
        rope=VortexRope(simulation.rope_force_n, simulation.rope_order),
        noise=TransducerNoise(
            gap_um_rms=simulation.gap_noise_um_rms,
            displacement_um_rms=simulation.gap_noise_um_rms,
            velocity_mm_s_rms=simulation.velocity_noise_mm_s_rms,
            acceleration_m_s2_rms=simulation.acceleration_noise_m_s2_rms,
        ),
    )


def simulation_of(unit: UnitSettings) -> SimulationSettings:
    """The settings of a unit's simulated machine.

    Raises
    ------
    LookupError
        If there are none.
    """
    if unit.simulation is None:
        raise LookupError(f"unit {unit.id} has no [unit.simulation] table")
    return unit.simulation


def _bearing_scenario(bearing: SimulatedBearingSettings) -> BearingScenario:
    return BearingScenario(
        film=Film.proportional(bearing.k_xx_n_per_m, bearing.k_yy_n_per_m, bearing.k_cross_n_per_m),
        centre_x_um=bearing.centre_x_um,
        centre_y_um=bearing.centre_y_um,
        centre_wander_um_rms=bearing.centre_wander_um_rms,
        oil_temperature_c=bearing.oil_temperature_c,
        oil_temperature_wander_c_rms=bearing.oil_temperature_wander_c_rms,
    )
