"""Simulated machines as sources: with constant films, or with a life of wear and damage."""

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
"""Setting keys of the transducer noise; without them, noise of real transducers is used."""

MAX_MISFIT = 0.005
"""Maximum relative difference between the settings of a unit and those of its machine life."""


def simulated_history(
    unit: UnitSettings, now_ns: int, years: float = 1.0
) -> Mapping[str, StiffnessHistory]:
    """Return simulated past readings by bearing; empty if the unit has no simulated machine life.

    The readings cover `years` before `now_ns`, ns since 1970 UTC, the start of the live samples of
    the same life.

    Raises
    ------
    ConfigError
        If the settings of the unit do not fit its machine life.
    ValueError
        If the machine life is shorter than `years`.
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
    return TransducerNoise(
        gap_um_rms=simulation.gap_noise_um_rms,
        displacement_um_rms=simulation.gap_noise_um_rms,
        velocity_mm_s_rms=simulation.velocity_noise_mm_s_rms,
        acceleration_m_s2_rms=simulation.acceleration_noise_m_s2_rms,
    )


def _refuse_misfit(unit: UnitSettings, simulation: SimulationSettings) -> None:
    clearances_um = {life.id: life.configured_clearance_um for life in LIFE_BEARINGS}
    brackets = {b.bearing: b.stiffness_n_per_m for b in RotorParameters().brackets}
    pairs = {
        "rated_speed_rpm": (unit.rated_speed_rpm, rated_speed_rpm(simulation.life_seed or 0)),
        "rated_power_mw": (unit.rated_power_mw, RATED_POWER_MW),
    }
    for bearing in unit.bearing:
        name, stiffness = bearing.id, bearing.bracket_stiffness_n_per_m
        pairs[f"{name} clearance_um"] = (bearing.clearance_um, clearances_um[name])
        pairs[f"{name} bracket_stiffness_n_per_m"] = (stiffness, brackets[name])
    for key, (found, wanted) in pairs.items():
        if found is not None and abs(found - wanted) > MAX_MISFIT * wanted:
            words = f"{key} = {found:g}, but life_seed requires {wanted:g}"
            raise ConfigError(f"unit {unit.id}: {words}")


def simulated_feed(unit: UnitSettings, clock: Clock) -> SimulatedUnit:
    """Return the simulated machine of a unit; its first sample is at the present time.

    Raises
    ------
    LookupError
        If the unit has no simulation settings.
    ConfigError
        If the settings of the unit do not fit its machine life.
    """
    simulation, now_ns = unit.simulation, clock.now_ns()
    if simulation is None:
        raise LookupError(f"unit {unit.id} has no [unit.simulation] table; add one")
    machine, calibration = machine_of(unit), calibration_of(unit)
    scenario: Scenario | LifeCourse
    if simulation.life_seed is None:
        scenario = scenario_of(simulation)
    else:
        _refuse_misfit(unit, simulation)
        noise = _noise(simulation) if NOISES & simulation.model_fields_set else TRANSDUCER_NOISE
        scenario = course_from(_plan(simulation, now_ns), now_ns, machine, noise)
    return SimulatedUnit(machine, calibration, scenario, simulation.seed, now_ns)


def scenario_of(simulation: SimulationSettings) -> Scenario:
    """Return the scenario of a simulated unit with constant films.

    Raises `LookupError` if the unit has a machine life instead of constant films.
    """
    if simulation.speed_rpm is None or simulation.power_mw is None:
        raise LookupError("a unit with life_seed has no constant scenario; remove life_seed")
    return Scenario(
        bearings={bearing.bearing: _bearing_scenario(bearing) for bearing in simulation.bearing},
        speed_rpm=simulation.speed_rpm,
        active_power_mw=simulation.power_mw,
        active_power_wander_mw_rms=simulation.power_wander_mw_rms,
        unbalance_grade_mm_s=simulation.unbalance_grade_mm_s,
        hydraulic=HydraulicNoise(simulation.hydraulic_force_n_rms, simulation.hydraulic_cutoff_hz),
        rope=VortexRope(simulation.rope_force_n, simulation.rope_order),
        noise=_noise(simulation),
    )


def _bearing_scenario(bearing: SimulatedBearingSettings) -> BearingScenario:
    return BearingScenario(
        film=Film.proportional(bearing.k_xx_n_per_m, bearing.k_yy_n_per_m, bearing.k_cross_n_per_m),
        **bearing.values_for(BearingScenario),
    )
