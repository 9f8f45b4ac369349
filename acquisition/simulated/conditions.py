"""What changes slowly while the machine runs: shaft centres, oil temperatures, power."""

import math
from dataclasses import dataclass

import numpy as np

from acquisition.simulated.scenario import Scenario
from core.arrays import FloatArray
from core.machine import Unit


@dataclass(frozen=True)
class Conditions:
    """Slow quantities at one instant; arrays run over the bearings of the machine.

    Parameters
    ----------
    centre_um
        (n_bearings, 2) shaft centre from bearing centre.
    oil_temperature_c
        (n_bearings,)
    """

    centre_um: FloatArray
    oil_temperature_c: FloatArray
    active_power_mw: float
    speed_rpm: float


def between(start: Conditions, stop: Conditions, fraction: float) -> Conditions:
    """Conditions part of the way from one instant to another."""

    def part(a: FloatArray, b: FloatArray) -> FloatArray:
        return a + fraction * (b - a)

    return Conditions(
        centre_um=part(start.centre_um, stop.centre_um),
        oil_temperature_c=part(start.oil_temperature_c, stop.oil_temperature_c),
        active_power_mw=start.active_power_mw
        + fraction * (stop.active_power_mw - start.active_power_mw),
        speed_rpm=start.speed_rpm,
    )


def slow_values(machine: Unit, now: Conditions) -> dict[str, float]:
    """Every slow channel the simulated unit has, by channel id; gaps in mm."""
    values: dict[str | None, float] = {
        machine.speed_channel: now.speed_rpm,
        machine.power_channel: now.active_power_mw,
    }
    directions = {channel.id: channel.direction for channel in machine.channels}
    for index, bearing in enumerate(machine.bearings):
        values[bearing.oil_temperature] = float(now.oil_temperature_c[index])
        for axis, (gap, probe) in enumerate(
            ((bearing.gap_x, bearing.shaft_x), (bearing.gap_y, bearing.shaft_y))
        ):
            centre_um = float(now.centre_um[index, axis])
            values[gap] = (bearing.gap_reference_um[axis] + directions[probe] * centre_um) / 1e3
    return {name: value for name, value in values.items() if name is not None}


class SlowWander:
    """First-order Gauss-Markov wander about the scenario's means, step by step."""

    def __init__(
        self, random: np.random.Generator, machine: Unit, scenario: Scenario, step_s: float
    ) -> None:
        bearings = [scenario.bearings[b.id] for b in machine.bearings]
        self._random = random
        self._speed_rpm = scenario.speed_rpm
        self._mean = np.array(
            [centre for b in bearings for centre in (b.centre_x_um, b.centre_y_um)]
            + [b.oil_temperature_c for b in bearings]
            + [scenario.active_power_mw]
        )
        self._rms = np.array(
            [b.centre_wander_um_rms for b in bearings for _ in "xy"]
            + [b.oil_temperature_wander_c_rms for b in bearings]
            + [scenario.active_power_wander_mw_rms]
        )
        self._memory = math.exp(-step_s / scenario.wander_time_s)
        self._deviation = np.zeros_like(self._mean)

    def now(self) -> Conditions:
        """Conditions at the present step."""
        values = self._mean + self._rms * self._deviation
        n_bearings = (values.size - 1) // 3
        return Conditions(
            centre_um=values[: 2 * n_bearings].reshape(-1, 2),
            oil_temperature_c=values[2 * n_bearings : -1],
            active_power_mw=float(values[-1]),
            speed_rpm=self._speed_rpm,
        )

    def advance(self) -> Conditions:
        """Move on by one step and give the conditions there."""
        fresh = self._random.standard_normal(self._mean.size)
        self._deviation = self._memory * self._deviation + math.sqrt(1 - self._memory**2) * fresh
        return self.now()
