"""The one place that names concrete adapters and stores."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from acquisition.clock import Clock
from acquisition.daq.ring_device import RingDevice, RingDeviceSettings
from acquisition.daq.ring_server import ModbusRingServer
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from acquisition.raw import RawFeed
from acquisition.recording.manifest import RecordedChannel, RecordedSlowChannel, RecordedUnit
from acquisition.recording.reader import Recording, open_recording
from acquisition.recording.selection import Selection, select
from acquisition.recording.source import RecordingSource
from acquisition.recording.writer import RecordingWriter
from acquisition.simulated.scenario import (
    BearingScenario,
    HydraulicNoise,
    Scenario,
    TransducerNoise,
    VortexRope,
)
from acquisition.simulated.source import SimulatedSource
from acquisition.simulated.unit import SimulatedUnit
from acquisition.source import SampleSource
from core.film import Film
from core.monitor import UnitMonitor
from service.conversion import analysis_of, calibration_of, machine_of
from service.runner import WatchedUnit
from service.settings import units as settings
from service.settings.plant import PlantFile
from service.settings.simulation import SimulatedBearingSettings, SimulationSettings
from service.store.port import Store
from service.store.sqlite import SqliteStore

DATABASE = "padwatch.sqlite3"


def watched_units(plant: PlantFile, clock: Clock) -> Mapping[str, WatchedUnit]:
    """Source and monitor of every unit of a plant."""
    analysis = analysis_of(plant.analysis)
    return {
        unit.id: WatchedUnit(source_of(unit, clock), UnitMonitor(machine_of(unit), analysis))
        for unit in plant.unit
    }


def source_of(unit: settings.UnitSettings, clock: Clock) -> SampleSource:
    """Where the samples of a unit come from."""
    source = unit.source
    match source:
        case settings.ModbusRingSettings():
            ring = ModbusRingSettings(**source.model_dump(exclude={"kind"}))
            return ModbusRingSource(ring, calibration_of(unit), clock)
        case settings.SimulatedSettings():
            feed = simulated_feed(unit, clock)
            return SimulatedSource(feed, calibration_of(unit), clock)


def simulated_feed(unit: settings.UnitSettings, clock: Clock) -> RawFeed:
    """The simulated machine of a unit, its first sample now.

    Raises
    ------
    LookupError
        If the unit has none.
    """
    simulation = _simulation(unit)
    scenario = scenario_of(simulation)
    machine, calibration = machine_of(unit), calibration_of(unit)
    return SimulatedUnit(machine, calibration, scenario, simulation.seed, clock.now_ns())


def simulated_daq(unit: settings.UnitSettings, clock: Clock) -> ModbusRingServer:
    """A Modbus TCP DAQ with the simulated machine of a unit behind it, where its source looks.

    Raises
    ------
    LookupError
        If the unit has no simulation, or its source is no Modbus ring.
    """
    source = unit.source
    if not isinstance(source, settings.ModbusRingSettings):
        raise LookupError(f'the source of unit {unit.id} is not of kind "modbus_ring"')
    simulation = _simulation(unit)
    shape = RingDeviceSettings(
        base_address=source.base_address,
        samples_per_slot=simulation.samples_per_slot,
        n_slots=simulation.n_slots,
    )
    device = RingDevice(simulated_feed(unit, clock), unit.id, shape)
    return ModbusRingServer(device, clock, source.host, source.port)


def recording_writer(unit: settings.UnitSettings, folder: Path, made_by: str) -> RecordingWriter:
    """A recording of a unit, about to be written.

    Raises
    ------
    ConfigError
        If the folder exists or cannot be made.
    """
    recorded = RecordedUnit(
        unit=unit.id,
        rate_hz=unit.rate_hz,
        channels=tuple(
            RecordedChannel(
                id=channel.id,
                measurand=channel.measurand,
                full_scale_v=channel.full_scale_v,
                unit_per_v=channel.unit_per_v,
                ok_min_v=channel.ok_min_v,
                ok_max_v=channel.ok_max_v,
            )
            for channel in unit.channel
        ),
        slow_channels=tuple(RecordedSlowChannel(**slow.model_dump()) for slow in unit.slow_channel),
    )
    return RecordingWriter(folder, recorded, made_by)


def recording_of(folder: Path) -> Recording:
    """A finished recording, checked from end to end.

    Raises
    ------
    ConfigError
        If anything about it is wrong.
    """
    return open_recording(folder)


def selection_of(recording: Recording, unit: settings.UnitSettings) -> Selection:
    """What a unit needs of a recording.

    Raises
    ------
    ConfigError
        If it is not there, or at another rate or in another unit.
    """
    slow_units = {channel.id: channel.unit for channel in unit.slow_channel}
    return select(recording.manifest, machine_of(unit), slow_units)


def recording_source(
    recording: Recording, selection: Selection, unit: settings.UnitSettings | None, clock: Clock
) -> SampleSource:
    """A recording as an unpaced source.

    Parameters
    ----------
    unit
        Whose calibration is to replace the recorded one, if any.
    """
    if unit is not None:
        selection = replace(selection, calibration=calibration_of(unit))
    return RecordingSource(recording, clock, selection)


def database_path(plant: PlantFile) -> Path:
    """Where the plant's database is, or would be."""
    return Path(plant.service.data_folder) / DATABASE


def open_store(plant: PlantFile) -> Store:
    """The plant's database, created if need be."""
    return SqliteStore(database_path(plant))


def scenario_of(simulation: SimulationSettings) -> Scenario:
    """What a simulated unit goes through."""
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


def _simulation(unit: settings.UnitSettings) -> SimulationSettings:
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
