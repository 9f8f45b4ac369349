"""Simulated machines and lives as sources."""

from collections.abc import Mapping

from acquisition.clock import Clock
from acquisition.errors import ConfigError
from acquisition.simulated.life.bearing import LIFE_BEARINGS
from acquisition.simulated.life.course import LifeCourse, LifePlan, course_from, history_until
from acquisition.simulated.life.damage import Damage, DamageKind
from acquisition.simulated.life.inputs import rated_speed_rpm
from acquisition.simulated.life.moment import TRANSDUCER_NOISE
from acquisition.simulated.life.operation import RATED_POWER_MW
from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.rotor import RotorParameters
from acquisition.simulated.plant.scenario import (
    BearingScenario,
    HydraulicNoise,
    Scenario,
    TransducerNoise,
    VortexRope,
)
from acquisition.simulated.plant.unit import SimulatedUnit
from core.baseline.history import StiffnessHistory
from core.units import ns_from_s
from service.settings.core_values import calibration_of, machine_of
from service.settings.sources.simulated import (
    SimulatedBearingSettings,
    SimulatedDamageSettings,
    SimulationSettings,
)
from service.settings.units import UnitSettings

NOISES = {"gap_noise_um_rms", "velocity_noise_mm_s_rms", "acceleration_noise_m_s2_rms"}
"""Keys of a simulation; without any of them, transducers are as noisy as real ones."""

MOST_APART = 0.005
"""Relative difference of a unit from its life that is let pass."""


def course_of_life(unit: UnitSettings, simulation: SimulationSettings, now_ns: int) -> LifeCourse:
    """The life of a unit from now on.

    Raises
    ------
    ConfigError
        If the unit cannot have this life; the message says why.
    """
    _refuse_misfit(unit, simulation)
    return course_from(_plan(simulation, now_ns), now_ns, machine_of(unit), _noise(simulation))


def simulated_history(
    unit: UnitSettings, now_ns: int, years: float = 1.0
) -> Mapping[str, StiffnessHistory]:
    """Readings of a unit's life until now, by bearing; none if it has no life.

    Parameters
    ----------
    now_ns
        On the day on which the simulated machine starts, for its samples to go on where these
        readings stop.

    Raises
    ------
    ConfigError
        If the unit cannot have this life.
    ValueError
        If the life does not reach so far back.
    """
    simulation = unit.simulation
    if simulation is None or simulation.life_seed is None:
        return {}
    _refuse_misfit(unit, simulation)
    readings = history_until(_plan(simulation, now_ns), now_ns, years).readings
    return {bearing.id: readings[bearing.id] for bearing in unit.bearing}


def _plan(simulation: SimulationSettings, now_ns: int) -> LifePlan:
    damage = tuple(_damage(one, now_ns) for one in simulation.damage)
    return LifePlan(simulation.life_seed or 0, simulation.held_load, damage)


def _damage(settings: SimulatedDamageSettings, now_ns: int) -> Damage:
    after_ns = now_ns + ns_from_s(settings.after_s or 0.0)
    return Damage(
        DamageKind(settings.kind),
        settings.bearing,
        after_ns if settings.at is None else ns_from_s(settings.at.timestamp()),
        settings.size,
        settings.ramp_s / 86_400.0,
        settings.directions,
    )


def _noise(simulation: SimulationSettings) -> TransducerNoise:
    if not NOISES & simulation.model_fields_set:
        return TRANSDUCER_NOISE
    return TransducerNoise(
        gap_um_rms=simulation.gap_noise_um_rms,
        displacement_um_rms=simulation.gap_noise_um_rms,
        velocity_mm_s_rms=simulation.velocity_noise_mm_s_rms,
        acceleration_m_s2_rms=simulation.acceleration_noise_m_s2_rms,
    )


def _refuse_misfit(unit: UnitSettings, simulation: SimulationSettings) -> None:
    """Refuse a unit whose readings would not be those of its life."""
    speed_rpm = rated_speed_rpm(simulation.life_seed or 0)
    _compare(unit, "rated_speed_rpm", unit.rated_speed_rpm, speed_rpm)
    if unit.rated_power_mw is not None:
        _compare(unit, "rated_power_mw", unit.rated_power_mw, RATED_POWER_MW)
    told_um = {life.id: life.configured_clearance_um for life in LIFE_BEARINGS}
    brackets = {b.bearing: b for b in RotorParameters().brackets}
    for bearing in unit.bearing:
        bracket, name = brackets[bearing.id], bearing.id
        _compare(unit, f"{name} clearance_um", bearing.clearance_um, told_um[name])
        stiffness = bearing.bracket_stiffness_n_per_m
        _compare(unit, f"{name} bracket_stiffness_n_per_m", stiffness, bracket.stiffness_n_per_m)


def _compare(unit: UnitSettings, key: str, found: float, wanted: float) -> None:
    if abs(found - wanted) > MOST_APART * wanted:
        raise ConfigError(f"unit {unit.id}: {key} = {found:g}, but its life is of {wanted:g}")


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
