"""From the motion of the machine to the readings of its transducers, chunk by chunk."""

import numpy as np

from acquisition.errors import ConfigError
from acquisition.simulated.plant.accelerometer_noise import AccelerometerNoise
from acquisition.simulated.plant.conditions import Conditions
from acquisition.simulated.plant.forces import straight
from acquisition.simulated.plant.key_phase import KeyPhasePulses
from acquisition.simulated.plant.probes import ShaftRunout, reference_gap_um, standing_gap_um
from acquisition.simulated.plant.response_filter import ResponseFilter
from acquisition.simulated.plant.scenario import ChannelScenario, Scenario, TransducerNoise
from core.arrays import FloatArray
from core.machine.channel import Measurand
from core.machine.unit import Unit


class TransducerChain:
    """Gap, runout, key-phase, response, gain and noise of every channel of one unit.

    Parameters
    ----------
    white, own
        Where white noise and the accelerometers' own noise come from.

    Raises
    ------
    ConfigError
        If the scenario names a channel the machine does not have, or asks for a response that
        cannot be simulated.
    """

    def __init__(
        self,
        machine: Unit,
        scenario: Scenario,
        white: np.random.Generator,
        own: np.random.Generator,
    ) -> None:
        channels = _channels(machine, scenario)
        self._machine = machine
        self._runout = ShaftRunout(machine, scenario)
        self._key_phase = KeyPhasePulses(machine, scenario.key_phase)
        self._filters = {
            row: ResponseFilter(channel.response, machine.rate_hz)
            for row, channel in enumerate(channels)
            if channel.response is not None
        }
        self._reference_um = reference_gap_um(machine)
        self._white, self._white_rms = white, noise_rms(machine, scenario.noise)
        self._noisy, self._own = _own_noise(machine, scenario.noise, own)

    def read(
        self, motion: FloatArray, turns: FloatArray, start: Conditions, stop: Conditions
    ) -> FloatArray:
        """Give what the transducers make of a chunk of motion, without white noise.

        Parameters
        ----------
        motion
            (n_channels, n_samples) in each channel's engineering unit; used up.
        turns
            (n_samples,) angle of the shaft.
        start, stop
            Conditions at the first sample and at the one that follows the last.
        """
        gap_um, next_gap_um = (standing_gap_um(self._machine, c) for c in (start, stop))
        motion += gap_um[:, np.newaxis]
        motion += np.outer(next_gap_um - gap_um, np.arange(turns.size) / turns.size)
        self._runout.add_to(motion, turns)
        self._key_phase.add_to(motion, turns)
        if self._own is not None:
            motion[self._noisy] += self._own.advance(turns.size)
        for row, response in self._filters.items():
            motion[row] = response.advance(motion[row])
        for row in np.flatnonzero((start.gain != 1.0) | (stop.gain != 1.0)).tolist():
            gain = straight(float(start.gain[row]), float(stop.gain[row]), turns.size)
            motion[row] = self._reference_um[row] + gain * (motion[row] - self._reference_um[row])
        return motion

    def add_white_noise(self, readings: FloatArray) -> None:
        """Add the noise of what stands behind the transducers, in place."""
        noise = self._white.standard_normal(readings.shape, dtype=np.float32)
        readings += noise * self._white_rms[:, np.newaxis]


def noise_rms(machine: Unit, noise: TransducerNoise) -> FloatArray:
    """White noise of each channel in its engineering unit, (n_channels,)."""
    by_measurand = {
        Measurand.GAP_UM: noise.gap_um_rms,
        Measurand.DISPLACEMENT_UM: noise.displacement_um_rms,
        Measurand.VELOCITY_MM_S: noise.velocity_mm_s_rms,
        Measurand.ACCELERATION_M_S2: noise.acceleration_m_s2_rms,
        Measurand.KEY_PHASE_V: noise.key_phase_v_rms,
    }
    return np.array([by_measurand[channel.measurand] for channel in machine.channels])


def _own_noise(
    machine: Unit, noise: TransducerNoise, random: np.random.Generator
) -> tuple[list[int], AccelerometerNoise | None]:
    """Rows of the accelerometers, and their noise if they have any."""
    integrated = {Measurand.VELOCITY_MM_S: True, Measurand.ACCELERATION_M_S2: False}
    rows = [r for r, channel in enumerate(machine.channels) if channel.measurand in integrated]
    if not rows or noise.accelerometer_g_per_sqrt_hz == 0.0:
        return rows, None
    return rows, AccelerometerNoise(
        random,
        tuple(integrated[machine.channels[row].measurand] for row in rows),
        noise.accelerometer_g_per_sqrt_hz,
        noise.accelerometer_corner_hz,
        machine.rate_hz,
    )


def _channels(machine: Unit, scenario: Scenario) -> list[ChannelScenario]:
    """What every channel of the machine is really like, in wire order."""
    strange = scenario.channels.keys() - {channel.id for channel in machine.channels}
    if strange:
        raise ConfigError(f"unit {machine.id!r} has no channel {', '.join(sorted(strange))}")
    return [scenario.channels.get(channel.id, ChannelScenario()) for channel in machine.channels]
