"""Slow quantities of a running machine: shaft position, temperature, power, gain."""

import math
from dataclasses import dataclass, fields

import numpy as np

from acquisition.simulated.plant.scenario import Scenario
from core.arrays import FloatArray
from core.machine.unit import Unit


@dataclass(frozen=True)
class Conditions:
    """Slow quantities of a unit at one instant.

    Parameters
    ----------
    centre_um
        (n_bearings, 2) position of the shaft centre relative to the bearing centre.
    position_error_um
        (n_bearings, 2) error of the position as measured by the gaps.
    oil_temperature_c
        (n_bearings,) true oil temperature.
    oil_temperature_error_c
        (n_bearings,) error of the thermometers.
    gap_growth_um
        (n_bearings,) common growth of all gaps of a bearing.
    gain
        (n_channels,) ratio of true to nominal sensitivity.
    """

    centre_um: FloatArray
    position_error_um: FloatArray
    oil_temperature_c: FloatArray
    oil_temperature_error_c: FloatArray
    gap_growth_um: FloatArray
    gain: FloatArray
    active_power_mw: float


def between(start: Conditions, stop: Conditions, fraction: float) -> Conditions:
    """Interpolate conditions linearly; return `start` at `fraction` 0, and `stop` at 1."""

    def part(name: str) -> FloatArray:
        a, b = getattr(start, name), getattr(stop, name)
        return np.asarray(a + fraction * (b - a))

    values = {field.name: part(field.name) for field in fields(Conditions)}
    power_mw = float(values.pop("active_power_mw"))
    return Conditions(**values, active_power_mw=power_mw)


class SlowWander:
    """Slow random variation of conditions about the means of a scenario (first-order Gauss-Markov).

    Parameters
    ----------
    random
        Random generator of all quantities except the gap growth.
    growth_random
        Random generator of the gap growth.
    scenario
        Scenario of the first step; it sets the rms of the variation, which does not change later.
    """

    def __init__(
        self,
        random: np.random.Generator,
        growth_random: np.random.Generator,
        machine: Unit,
        scenario: Scenario,
        step_s: float,
    ) -> None:
        self._machine = machine
        bearings = [scenario.bearings[b.id] for b in machine.bearings]
        rms = [b.centre_wander_um_rms for b in bearings for _ in "xy"]
        rms += [b.oil_temperature_wander_c_rms for b in bearings]
        rms += [scenario.active_power_wander_mw_rms]
        growth_rms = [b.gap_growth_wander_um_rms for b in bearings]
        memory = math.exp(-step_s / scenario.wander_time_s)
        self._rest = _Wander(random, memory, np.array(rms))
        self._growth = _Wander(growth_random, memory, np.array(growth_rms))

    def now(self, scenario: Scenario) -> Conditions:
        """Return the conditions at the current step: means of a scenario with random variation."""
        bearings = [scenario.bearings[b.id] for b in self._machine.bearings]
        mean = [centre for b in bearings for centre in (b.centre_x_um, b.centre_y_um)]
        mean += [b.oil_temperature_c for b in bearings] + [scenario.active_power_mw]
        values = self._rest.about(np.array(mean))
        n_bearings = len(bearings)
        return Conditions(
            centre_um=values[: 2 * n_bearings].reshape(-1, 2),
            position_error_um=np.array([b.position_error_um for b in bearings]),
            oil_temperature_c=values[2 * n_bearings : -1],
            oil_temperature_error_c=np.array([b.oil_temperature_error_c for b in bearings]),
            gap_growth_um=self._growth.about(np.array([b.gap_growth_um for b in bearings])),
            gain=np.array([scenario.channel(c.id).gain for c in self._machine.channels]),
            active_power_mw=float(values[-1]),
        )

    def advance(self) -> None:
        """Advance the random variation by one step of `step_s`."""
        self._rest.advance()
        self._growth.advance()


class _Wander:
    def __init__(self, random: np.random.Generator, memory: float, rms: FloatArray) -> None:
        self._random, self._memory, self._rms = random, memory, rms
        self._deviation = np.zeros_like(rms)

    def about(self, mean: FloatArray) -> FloatArray:
        return np.asarray(mean + self._rms * self._deviation)

    def advance(self) -> None:
        fresh = self._random.standard_normal(self._rms.size)
        self._deviation = self._memory * self._deviation + math.sqrt(1 - self._memory**2) * fresh
