"""Transducer chain of a unit: gap, runout, key phase, frequency response, gain and noise.

The noise of accelerometers is white with a 1/f rise below a corner frequency; velocity channels
integrate it. A high-pass of order 2 at `FLOOR_HZ` limits it, because the power of integrated 1/f
noise is infinite towards 0 Hz, and charge amplifiers do not pass low frequencies either.
"""

import math
from collections.abc import Iterator

import numpy as np

from acquisition.errors import ConfigError
from acquisition.simulated.plant.conditions import Conditions
from acquisition.simulated.plant.excitation import straight
from acquisition.simulated.plant.probes import ShaftRunout, standing_gap_um
from acquisition.simulated.plant.response_filter import ResponseFilter
from acquisition.simulated.plant.scenario import (
    ChannelScenario,
    KeyPhasePulse,
    Scenario,
    TransducerNoise,
)
from core.arrays import FloatArray
from core.machine.channel import Measurand
from core.machine.unit import Unit
from core.units import STANDARD_GRAVITY_M_S2


class KeyPhasePulses:
    """Signal of the key-phase channels: one pulse per turn.

    The converter averages over its sampling interval: a sample on an edge of the pulse is
    proportional to the share of the interval within the pulse.
    """

    def __init__(self, machine: Unit, pulse: KeyPhasePulse) -> None:
        self._directions = {
            row: channel.direction
            for row, channel in enumerate(machine.channels)
            if channel.measurand is Measurand.KEY_PHASE_V
        }
        self._pulse = pulse

    def add_to(self, readings: FloatArray, turns: FloatArray) -> None:
        """Add the pulses to the readings of the key-phase channels, in place.

        `readings` are (n_channels, n_samples); `turns` (n_samples,) is the angle of the shaft in
        turns, at nearly constant speed.
        """
        if not self._directions:
            return
        step = (turns[-1] - turns[0]) / (turns.size - 1)
        passed = np.fmod(turns, 1.0) + self._pulse.mark_turns
        if step > 0.0:
            filled = (self._so_far(passed + step / 2) - self._so_far(passed - step / 2)) / step
        else:  # standstill, with the mark at the pick-up or not
            filled = (np.fmod(passed, 1.0) < self._pulse.width_turns).astype(np.float64)
        for row, direction in self._directions.items():
            readings[row] += self._pulse.rest_v + direction * self._pulse.height_v * filled

    def _so_far(self, turns: FloatArray) -> FloatArray:
        """Return the total angle within pulses from turn 0, in turns."""
        whole = np.floor(turns)
        covered: FloatArray = whole * self._pulse.width_turns
        covered += np.minimum(turns - whole, self._pulse.width_turns)
        return covered


FLOOR_HZ = 0.1
PINK_BAND_HZ = (0.02, 60.0)
"""Band of the 1/f noise; its power is accurate to 2 %, and to 0.3 % from 0.1 to 25 Hz."""
POLES_PER_DECADE = 3


class AccelerometerNoise:
    """Generator of continuous accelerometer noise.

    Parameters
    ----------
    integrated
        (n_channels,) true for velocity channels in mm/s, false for acceleration in m/s².
    density_g_per_sqrt_hz
        One-sided amplitude density above `corner_hz`, the corner frequency of the 1/f noise.
    """

    def __init__(
        self,
        random: np.random.Generator,
        integrated: tuple[bool, ...],
        density_g_per_sqrt_hz: float,
        corner_hz: float,
        rate_hz: float,
    ) -> None:
        self._random = random
        self._n_channels = len(integrated)
        # a one-sided density of 1 over the band up to half the rate is a variance of rate / 2
        self._white = density_g_per_sqrt_hz * STANDARD_GRAVITY_M_S2 * math.sqrt(rate_hz / 2.0)
        self._pink = _pink(corner_hz, rate_hz)
        self._floors = [_floor(velocity, rate_hz) for velocity in integrated]
        self._pink_state = np.zeros((len(self._pink), len(integrated), 2))
        self._floor_states = [np.zeros((len(floor), 2)) for floor in self._floors]

    def advance(self, n_samples: int) -> FloatArray:
        """Return the next noise samples, (n_channels, n_samples)."""
        import scipy.signal  # slow import, not needed at start-up

        white, pink = self._white * self._random.standard_normal((2, self._n_channels, n_samples))
        pink, self._pink_state = scipy.signal.sosfilt(self._pink, pink, zi=self._pink_state)
        return np.array(list(self._floored(white + pink))).reshape(white.shape)

    def _floored(self, noise: FloatArray) -> Iterator[FloatArray]:
        import scipy.signal  # slow import, not needed at start-up

        for channel, floor in enumerate(self._floors):
            row, self._floor_states[channel] = scipy.signal.sosfilt(
                floor, noise[channel], zi=self._floor_states[channel]
            )
            yield row


def _floor(integrates: bool, rate_hz: float) -> FloatArray:
    """Return a high-pass of order 2 for m/s²; with `integrates`, its output is in mm/s."""
    import scipy.signal  # slow import, not needed at start-up

    floor_rad_s = 2.0 * math.pi * FLOOR_HZ
    numerator = [1e3, 0.0] if integrates else [1.0, 0.0, 0.0]
    denominator = [1.0, math.sqrt(2.0) * floor_rad_s, floor_rad_s**2]
    return np.atleast_2d(np.hstack(scipy.signal.bilinear(numerator, denominator, rate_hz)))


def _pink(corner_hz: float, rate_hz: float) -> FloatArray:
    """Return a filter with power gain corner / f, poles and zeros alternating (Oustaloup, 1991)."""
    import scipy.signal  # slow import, not needed at start-up

    low_hz, high_hz = PINK_BAND_HZ
    high_hz = min(high_hz, 0.3 * rate_hz)
    n_poles = math.ceil(POLES_PER_DECADE * math.log10(high_hz / low_hz))
    edges_hz = np.geomspace(low_hz / 4.0, 4.0 * high_hz, 2 * n_poles + 1)
    poles, zeros = -2 * np.pi * edges_hz[0:-1:2], -2 * np.pi * edges_hz[1::2]
    middle = 2j * np.pi * math.sqrt(low_hz * high_hz)
    shape = abs(np.prod(middle - zeros) / np.prod(middle - poles))
    wanted = math.sqrt(2 * np.pi * corner_hz / abs(middle))
    sections: FloatArray = scipy.signal.zpk2sos(
        *scipy.signal.bilinear_zpk(zeros, poles, wanted / shape, rate_hz)
    )
    return sections


class TransducerChain:
    """Transducers of all channels of one unit: converts motion of the rotor to readings.

    `white` and `own` are the random generators of the white noise and of the sensor noise of the
    accelerometers.

    Raises ConfigError if the scenario names an unknown channel or a response that cannot be
    simulated.
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
        self._reference_um = standing_gap_um(machine)
        self._white, self._white_rms = white, _noise_rms(machine, scenario.noise)
        self._noisy, self._own = _own_noise(machine, scenario.noise, own)

    def read(
        self, motion: FloatArray, turns: FloatArray, start: Conditions, stop: Conditions
    ) -> FloatArray:
        """Return the readings of the transducers for a chunk of motion, without white noise.

        Parameters
        ----------
        motion
            (n_channels, n_samples) in the engineering unit of each channel; overwritten.
        turns
            (n_samples,) angle of the shaft in turns.
        start, stop
            Conditions at the first sample and one sample after the last.
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
        """Add the white noise of the electronics to readings (n_channels, n_samples), in place."""
        noise = self._white.standard_normal(readings.shape, dtype=np.float32)
        readings += noise * self._white_rms[:, np.newaxis]


def _noise_rms(machine: Unit, noise: TransducerNoise) -> FloatArray:
    """Return the rms of the white noise of each channel in its engineering unit, (n_channels,)."""
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
    """Return the rows of the accelerometers and their noise generator; None without noise."""
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
    """Return the scenarios of all channels, in the channel order of the machine."""
    unknown = scenario.channels.keys() - {channel.id for channel in machine.channels}
    if unknown:
        names = ", ".join(sorted(unknown))
        raise ConfigError(f"unit {machine.id!r} has no channel {names}; correct the scenario")
    return [scenario.channel(channel.id) for channel in machine.channels]
