"""A moment of a simulated life, sampled at 600 Hz, and what a monitor reads off the samples.

Rotor, transducers, converter, calibration, blocks, segments, estimators and readings are the real
ones; so are the settings.
"""

import math
from dataclasses import dataclass

from acquisition.delivery.blocks import BlockAssembler
from acquisition.simulated.life.bearing import LIFE_BEARINGS, LifeBearing
from acquisition.simulated.life.truth import RUNOUT_UM_PK
from acquisition.simulated.plant.plant import CHUNK_SAMPLES
from acquisition.simulated.plant.rotor import RotorParameters
from acquisition.simulated.plant.scenario import Scenario
from acquisition.simulated.plant.unit import SimulatedUnit
from core.change.film_reading import FilmReading, film_reading
from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Estimator, Unit
from core.monitor.assessment import AnalysisSettings, Assessment
from core.monitor.monitor import UnitMonitor
from core.samples.calibration import ChannelCalibration, SlowCalibration, UnitCalibration
from core.units import ns_from_s

RATE_HZ = 600.0
REFERENCE_UM = (2000.0, 2000.0)
PROBE = ChannelCalibration(full_scale_v=20.0, unit_per_v=-250.0, ok_min_v=-18.0, ok_max_v=-2.0)
ACCELEROMETER = ChannelCalibration(10.0, 0.05, -10.0, 10.0)
"""Full scale of 0.5 m/s²."""

SETTINGS = AnalysisSettings()
WINDOW_SAMPLES = SETTINGS.segment_samples + (SETTINGS.n_segments - 1) * SETTINGS.hop_samples
UNKNOWN = BearingCondition(OperatingState.UNKNOWN, False, None)


@dataclass(frozen=True)
class Window:
    """What is sampled for one reading: a scenario, held for as long as one average takes."""

    time_ns: int
    scenario: Scenario
    seed: int


def machine() -> Unit:
    """The paper's machine with four probes and two accelerometers at each bearing."""
    brackets = {b.bearing: b for b in RotorParameters().brackets}
    channels: list[Channel] = []
    bearings = []
    for life in LIFE_BEARINGS:
        bracket = brackets[life.id]
        bearings.append(_bearing(life, bracket.stiffness_n_per_m, bracket.mass_kg))
        channels += _channels(life.id)
    return Unit("U1", 92.3, RATE_HZ, tuple(channels), tuple(bearings), "speed", "power")


def _bearing(life: LifeBearing, bracket_n_per_m: float, bracket_kg: float) -> Bearing:
    ux, uy, ax, ay, far_x, far_y = (channel.id for channel in _channels(life.id))
    return Bearing(
        *(life.id, bracket_n_per_m, ux, uy, ax, ay),
        clearance_um=life.configured_clearance_um,
        gap_reference_um=REFERENCE_UM,
        oil_temperature=f"{life.id}_oil",
        opposite_x=far_x,
        opposite_y=far_y,
        opposite_reference_um=REFERENCE_UM,
        bracket_mass_kg=bracket_kg,
        runout_um_pk=RUNOUT_UM_PK,
    )


def _channels(bearing: str) -> list[Channel]:
    return [
        *(Channel(f"{bearing}_{id_}", Measurand.GAP_UM, direction=-1) for id_ in ("ux", "uy")),
        *(Channel(f"{bearing}_{id_}", Measurand.ACCELERATION_M_S2) for id_ in ("ax", "ay")),
        *(Channel(f"{bearing}_{id_}", Measurand.GAP_UM) for id_ in ("far_x", "far_y")),
    ]


def calibration(unit: Unit) -> UnitCalibration:
    slow = ("speed", "power", *(str(bearing.oil_temperature) for bearing in unit.bearings))
    return UnitCalibration(
        unit.id,
        unit.rate_hz,
        tuple(PROBE if c.measurand is Measurand.GAP_UM else ACCELEROMETER for c in unit.channels),
        tuple(SlowCalibration(id_, -100.0, 1000.0) for id_ in slow),
    )


UNIT = machine()
CALIBRATION = calibration(UNIT)


def readings(window: Window) -> list[FilmReading]:
    """Sample, analyse and read; one reading of every bearing, its condition yet to be told."""
    start_ns = window.time_ns - ns_from_s(WINDOW_SAMPLES / RATE_HZ)
    feed = SimulatedUnit(UNIT, CALIBRATION, window.scenario, window.seed, start_ns)
    delivery, monitor = BlockAssembler(CALIBRATION), UnitMonitor(UNIT, SETTINGS)
    newest: list[Assessment] = []
    for _ in range(math.ceil(WINDOW_SAMPLES / CHUNK_SAMPLES)):
        for block in delivery.take([feed.advance(CHUNK_SAMPLES)]):
            newest = list(monitor.steps(block)) or newest
    return [film_reading(found, UNKNOWN, Estimator.DYNAMIC) for found in newest]
