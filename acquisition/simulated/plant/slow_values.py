"""What the slow channels of a simulated unit report."""

from acquisition.simulated.plant.conditions import Conditions
from acquisition.simulated.plant.probes import gap_um, probes
from core.machine.unit import Unit


def slow_values(machine: Unit, now: Conditions, speed_rpm: float) -> dict[str, float]:
    """Every slow channel the simulated unit has, by channel id; gaps in mm."""
    values: dict[str | None, float] = {
        machine.speed_channel: speed_rpm,
        machine.power_channel: now.active_power_mw,
    }
    for index, bearing in enumerate(machine.bearings):
        shown_c = now.oil_temperature_c[index] + now.oil_temperature_error_c[index]
        values[bearing.oil_temperature] = float(shown_c)
    rows = {channel.id: row for row, channel in enumerate(machine.channels)}
    for probe in probes(machine):
        row = rows[probe.channel]
        from_reference_um = gap_um(probe, machine.channels[row].direction, now) - probe.reference_um
        shown_um = probe.reference_um + float(now.gain[row]) * from_reference_um
        values[probe.slow_channel] = shown_um / 1e3
    return {name: value for name, value in values.items() if name is not None}
