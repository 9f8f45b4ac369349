"""Waveform channels: what one measures, and what its spectrum says about displacement."""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.machine.response import Response

MAX_SLOW_ROLL_FRACTION = 0.25
"""Share of the rated speed up to which unbalance forces (under 1/16) leave the surface alone."""


@dataclass(frozen=True)
class SlowRollVector:
    """Reading of one probe at 1× at slow roll: the runout of the shaft.

    Parameters
    ----------
    probe
        Serial number or mark of the probe; another probe, or this one moved, sees another surface.
    phasor_um_pk
        Displacement along the axis, relative to the mark on the shaft: its phase is that of the
        reading when the mark passes the key-phase pick-up.
    """

    channel: str
    probe: str
    phasor_um_pk: complex
    speed_rpm: float
    taken_ns: int


class Measurand(StrEnum):
    """What a waveform channel measures, and therefore its engineering unit."""

    GAP_UM = "gap_um"
    DISPLACEMENT_UM = "displacement_um"
    VELOCITY_MM_S = "velocity_mm_s"
    ACCELERATION_M_S2 = "acceleration_m_s2"
    KEY_PHASE_V = "key_phase_v"

    @property
    def n_integrations(self) -> int:
        """How many integrations turn it into displacement: 2 for acceleration, 1 for velocity."""
        return {Measurand.ACCELERATION_M_S2: 2, Measurand.VELOCITY_MM_S: 1}.get(self, 0)


@dataclass(frozen=True)
class Channel:
    """A waveform channel.

    Parameters
    ----------
    direction
        +1 if a growing reading means motion along the positive bearing axis, -1 if against it. A
        probe mounted on the positive axis sees its gap shrink as the shaft approaches: -1. Of a
        key-phase, -1 if its pulses fall.
    delay_s
        By how much the channel is read later than the others, s.
    line_floor
        Amplitude of a line of the transducer's own noise, zero-to-peak in the channel's unit.
    unit_per_count
        The channel's unit per count of its converter; zero where it is not known.
    ok_limits
        Lowest and highest mean of a healthy transducer, in the channel's unit.
    probe
        Serial number or mark of the probe that is there; empty where it is not known.
    slow_roll
        Runout of the shaft under it, where it was measured.
    """

    id: str
    measurand: Measurand
    direction: int = 1
    response: Response | None = None
    delay_s: float = 0.0
    line_floor: float = 0.0
    unit_per_count: float = 0.0
    ok_limits: tuple[float, float] = (-math.inf, math.inf)
    probe: str = ""
    slow_roll: SlowRollVector | None = None


def displacement_factor(channel: Channel, frequency_hz: FloatArray) -> ComplexArray:
    """Displacement phasor (n_lines,) in µm per phasor of the channel's own engineering unit.

    Velocity is integrated once, acceleration twice, by division by iω and (iω)²; the transducer's
    response and the channel's delay are compensated. A key-phase shows no displacement: zero.

    Raises
    ------
    ValueError
        If a frequency is not above zero: a constant velocity has no displacement phasor.
    """
    if np.any(frequency_hz <= 0.0):
        raise ValueError(f"frequencies must be positive, got {frequency_hz.min()} Hz")
    if channel.measurand is Measurand.KEY_PHASE_V:
        return np.zeros(np.shape(frequency_hz), dtype=np.complex128)
    n = channel.measurand.n_integrations
    factor = 10.0 ** (3 * n) / (2j * np.pi * frequency_hz) ** n
    if channel.delay_s:
        factor = factor * np.exp(2j * np.pi * frequency_hz * channel.delay_s)
    if channel.response is not None:
        factor = factor / channel.response.at(frequency_hz)
    return np.asarray(channel.direction * factor, dtype=np.complex128)


def line_floor_um_pk(channel: Channel, frequency_hz: float) -> float:
    """Displacement that a line of the transducer's own noise is read as, µm zero-to-peak.

    It grows with falling frequency where the signal is integrated or the response falls off.
    """
    factor = displacement_factor(channel, np.array([frequency_hz]))[0]
    return float(abs(factor)) * channel.line_floor
