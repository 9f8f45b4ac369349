"""The pulses of a key-phase pick-up, one a turn, as a converter samples them."""

import numpy as np

from acquisition.simulated.plant.scenario import KeyPhasePulse
from core.arrays import FloatArray
from core.machine.channel import Measurand
from core.machine.unit import Unit


class KeyPhasePulses:
    """Pulses that begin whenever the shaft has completed a turn, on every key-phase channel.

    The converter averages over its sampling interval, so that a sample on an edge tells how much of
    the interval the pulse filled.
    """

    def __init__(self, machine: Unit, pulse: KeyPhasePulse) -> None:
        self._directions = {
            row: channel.direction
            for row, channel in enumerate(machine.channels)
            if channel.measurand is Measurand.KEY_PHASE_V
        }
        self._pulse = pulse

    def add_to(self, readings: FloatArray, turns: FloatArray) -> None:
        """Add the pulses to the key-phase channels, in place.

        Parameters
        ----------
        readings
            (n_channels, n_samples)
        turns
            (n_samples,) angle of the shaft; its speed hardly changes within them.
        """
        if not self._directions:
            return
        step = (turns[-1] - turns[0]) / (turns.size - 1)
        passed = np.fmod(turns, 1.0) + self._pulse.mark_turns
        if step > 0.0:
            filled = (self._so_far(passed + step / 2) - self._so_far(passed - step / 2)) / step
        else:  # standing still, under the mark or not
            filled = (np.fmod(passed, 1.0) < self._pulse.width_turns).astype(np.float64)
        for row, direction in self._directions.items():
            readings[row] += self._pulse.rest_v + direction * self._pulse.height_v * filled

    def _so_far(self, turns: FloatArray) -> FloatArray:
        """How much of the way since turn 0 lay under the pulse."""
        whole = np.floor(turns)
        covered: FloatArray = whole * self._pulse.width_turns
        covered += np.minimum(turns - whole, self._pulse.width_turns)
        return covered
