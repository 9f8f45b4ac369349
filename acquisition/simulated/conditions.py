"""What changes slowly while the machine runs: shaft centres, oil temperatures, growth, power."""

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
    gap_growth_um
        (n_bearings,) what all gaps of a bearing have in common.
    """

    centre_um: FloatArray
    oil_temperature_c: FloatArray
    gap_growth_um: FloatArray
    active_power_mw: float


def between(start: Conditions, stop: Conditions, fraction: float) -> Conditions:
    """Conditions part of the way from one instant to another."""

    def part(a: FloatArray, b: FloatArray) -> FloatArray:
        return a + fraction * (b - a)

    return Conditions(
        centre_um=part(start.centre_um, stop.centre_um),
        oil_temperature_c=part(start.oil_temperature_c, stop.oil_temperature_c),
        gap_growth_um=part(start.gap_growth_um, stop.gap_growth_um),
        active_power_mw=start.active_power_mw
        + fraction * (stop.active_power_mw - start.active_power_mw),
    )


class SlowWander:
    """First-order Gauss-Markov wander about the scenario's means, step by step.

    Parameters
    ----------
    random, growth_random
        Where the wander of everything but the gaps' growth, and that of the growth, comes from.
    """

    def __init__(
        self,
        random: np.random.Generator,
        growth_random: np.random.Generator,
        machine: Unit,
        scenario: Scenario,
        step_s: float,
    ) -> None:
        bearings = [scenario.bearings[b.id] for b in machine.bearings]
        mean = [centre for b in bearings for centre in (b.centre_x_um, b.centre_y_um)]
        mean += [b.oil_temperature_c for b in bearings] + [scenario.active_power_mw]
        rms = [b.centre_wander_um_rms for b in bearings for _ in "xy"]
        rms += [b.oil_temperature_wander_c_rms for b in bearings]
        rms += [scenario.active_power_wander_mw_rms]
        memory = math.exp(-step_s / scenario.wander_time_s)
        self._rest = _Wander(random, memory, np.array(mean), np.array(rms))
        self._growth = _Wander(
            growth_random,
            memory,
            np.array([b.gap_growth_um for b in bearings]),
            np.array([b.gap_growth_wander_um_rms for b in bearings]),
        )

    def now(self) -> Conditions:
        """Conditions at the present step."""
        values, growth_um = self._rest.now(), self._growth.now()
        n_bearings = growth_um.size
        return Conditions(
            centre_um=values[: 2 * n_bearings].reshape(-1, 2),
            oil_temperature_c=values[2 * n_bearings : -1],
            gap_growth_um=growth_um,
            active_power_mw=float(values[-1]),
        )

    def advance(self) -> Conditions:
        """Move on by one step and give the conditions there."""
        self._rest.advance()
        self._growth.advance()
        return self.now()


class _Wander:
    def __init__(
        self, random: np.random.Generator, memory: float, mean: FloatArray, rms: FloatArray
    ) -> None:
        self._random, self._memory = random, memory
        self._mean, self._rms = mean, rms
        self._deviation = np.zeros_like(mean)

    def now(self) -> FloatArray:
        return np.asarray(self._mean + self._rms * self._deviation)

    def advance(self) -> None:
        fresh = self._random.standard_normal(self._mean.size)
        self._deviation = self._memory * self._deviation + math.sqrt(1 - self._memory**2) * fresh
