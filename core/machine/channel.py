"""Waveform channels, conversion of their phasors to displacement, and recorded slow channels."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.machine.response import Response

MAX_SLOW_ROLL_FRACTION = 0.25
"""Largest slow-roll speed as a fraction of rated speed. The unbalance force is then at most 1/16 of
that at rated speed."""


@dataclass(frozen=True)
class SlowRollVector:
    """1× vector of one proximity probe at slow roll: the runout of the shaft under the probe.

    Parameters
    ----------
    probe
        Serial number or mark of the probe. A replaced or moved probe reads another surface.
    phasor_um_pk
        Displacement phasor along the positive bearing axis. Its phase is that of the signal at the
        moment when the mark on the shaft passes the key-phase pick-up.
    speed_rpm
        Speed of the measurement.
    """

    probe: str
    phasor_um_pk: complex
    speed_rpm: float


class Measurand(StrEnum):
    """Measured quantity of a waveform channel; it determines the engineering unit."""

    GAP_UM = "gap_um"
    DISPLACEMENT_UM = "displacement_um"
    VELOCITY_MM_S = "velocity_mm_s"
    ACCELERATION_M_S2 = "acceleration_m_s2"
    KEY_PHASE_V = "key_phase_v"

    @property
    def n_integrations(self) -> int:
        """Number of integrations to displacement: 2 for acceleration, 1 for velocity, else 0."""
        return {Measurand.ACCELERATION_M_S2: 2, Measurand.VELOCITY_MM_S: 1}.get(self, 0)


@dataclass(frozen=True)
class Channel:
    """Waveform channel: measured quantity, direction, frequency response and limits.

    Parameters
    ----------
    direction
        +1 if a growing reading means motion along the positive bearing axis, -1 if against it. The
        gap of a probe on the positive axis shrinks as the shaft approaches: -1. For a key-phase
        channel, -1 if its pulses fall.
    angle_deg
        Angle from x towards y of the axis that the channel measures along; None if it is the axis
        of the bearing that names the channel. The signals are resolved into x and y.
    response
        Frequency response of transducer and amplifier, relative to the sensitivity; None if flat.
    delay_s
        Time by which the channel is sampled later than channels with delay 0, s.
    line_floor
        Amplitude that the transducer's own noise gives a spectral line, zero-to-peak in the
        channel's unit.
    unit_per_count
        Engineering units per count of the converter; zero if unknown.
    ok_limits
        Lowest and highest mean of a healthy transducer, in the channel's unit.
    probe
        Serial number or mark of the installed probe; empty if unknown.
    slow_roll
        Runout of the shaft under the probe; None if it was not measured.
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
    angle_deg: float | None = None


def displacement_factor(channel: Channel, frequency_hz: FloatArray) -> ComplexArray:
    """Return factors (n_lines,) that convert phasors in the channel's unit to µm displacement.

    The frequencies (n_lines,) are positive. Velocity is integrated once, acceleration twice; the
    transducer's response and the channel's delay are compensated. Key-phase channels give zero.
    """
    if channel.measurand is Measurand.KEY_PHASE_V:
        return np.zeros(np.shape(frequency_hz), dtype=np.complex128)
    n = channel.measurand.n_integrations
    factor = 10.0 ** (3 * n) / (2j * np.pi * frequency_hz) ** n
    if channel.delay_s:
        factor = factor * np.exp(2j * np.pi * frequency_hz * channel.delay_s)
    if channel.response is not None:
        factor = factor / channel.response.at(frequency_hz)
    return np.asarray(channel.direction * factor, dtype=np.complex128)


def displacement_factors(channels: Sequence[Channel], frequency_hz: FloatArray) -> ComplexArray:
    """Return the `displacement_factor` of each channel at each frequency, (n_channels, n_lines)."""
    kinds = [(c.measurand, c.direction, c.response, c.delay_s) for c in channels]
    alike = dict(zip(kinds, channels, strict=True))
    factors = {kind: displacement_factor(channel, frequency_hz) for kind, channel in alike.items()}
    return np.array([factors[kind] for kind in kinds])


@dataclass(frozen=True)
class SlowQuantity:
    """Kind of slow quantity, such as pad temperature, with its names and units.

    Parameters
    ----------
    name
        Name in the plant file, and name of the alarm kind of its limits.
    suffix
        Unit at the end of the names of its readings.
    unit
        Displayed unit.
    setting
        Unit in the plant file.
    """

    name: str
    label: str
    suffix: str
    unit: str
    setting: str


def _table(suffix: str, unit: str, setting: str, **labels: str) -> dict[str, SlowQuantity]:
    return {name: SlowQuantity(name, of, suffix, unit, setting) for name, of in labels.items()}


SLOW_QUANTITIES: Mapping[str, SlowQuantity] = {
    **_table(
        "c",
        "°C",
        "degC",
        pad_temperature="Pad temperature",
        oil_inlet_temperature="Oil temperature, inlet",
        oil_outlet_temperature="Oil temperature, outlet",
        cooling_water_inlet_temperature="Cooling water temperature, inlet",
        cooling_water_outlet_temperature="Cooling water temperature, outlet",
        cold_air_temperature="Cold air temperature",
        hot_air_temperature="Hot air temperature",
        stator_temperature="Stator temperature",
        rotor_temperature="Rotor temperature",
    ),
    **_table("m", "m", "m", head="Head"),
    **_table("percent", "%", "%", gate_opening="Gate opening"),
    **_table("a", "A", "A", excitation_current="Excitation current"),
    **_table("v", "V", "V", excitation_voltage="Excitation voltage"),
}
"""Slow quantities by name: those that Brito et al., section 4, ask to monitor beside the oil
temperature and the shaft position, and those of the turbine and the excitation."""

PAD_TEMPERATURE = "pad_temperature"
"""Slow quantity from which the pattern of a bearing's pad temperatures is computed."""


@dataclass(frozen=True)
class SlowChannel:
    """Slow channel with a recorded quantity.

    Parameters
    ----------
    quantity
        Key of `SLOW_QUANTITIES`.
    bearing
        Id of the bearing; None for a quantity of the unit, which is recorded with every bearing.
    position
        Number or word that distinguishes the channels of one quantity; may be empty.
    angle_deg
        Angle of the position around the bearing, from x towards y; None if unknown.
    """

    id: str
    quantity: str
    bearing: str | None = None
    position: str = ""
    angle_deg: float | None = None

    @property
    def reading(self) -> str:
        """Name of the channel's reading, such as "pad_temperature_3_c"."""
        parts = (self.quantity, self.position, SLOW_QUANTITIES[self.quantity].suffix)
        return "_".join(filter(None, parts))
