"""What the slow channels of a simulated unit report."""

from acquisition.simulated.conditions import Conditions
from acquisition.simulated.probes import gap_um, probes
from core.machine import Unit


def slow_values(machine: Unit, now: Conditions, speed_rpm: float) -> dict[str, float]:
    """Every slow channel the simulated unit has, by channel id; gaps in mm."""
    values: dict[str | None, float] = {
        machine.speed_channel: speed_rpm,
        machine.power_channel: now.active_power_mw,
    }
    for index, bearing in enumerate(machine.bearings):
        values[bearing.oil_temperature] = float(now.oil_temperature_c[index])
    directions = {channel.id: channel.direction for channel in machine.channels}
    for probe in probes(machine):
        values[probe.slow_channel] = gap_um(probe, directions[probe.channel], now) / 1e3
    return {name: value for name, value in values.items() if name is not None}
