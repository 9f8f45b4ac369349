"""The machine as the numerics see it: which channel measures what, on which bearing."""

import math
from dataclasses import dataclass, field
from enum import StrEnum

from core.machine.bracket import BracketDynamics
from core.machine.response import Response


class Estimator(StrEnum):
    """Where a stiffness may come from. The names appear in settings, API and store."""

    DYNAMIC = "dynamic"
    TRANSFER_ORDER1 = "transfer_order1"
    TRANSFER_VORTEX = "transfer_vortex"
    RATIO_ORDER1 = "ratio_order1"
    RATIO_VORTEX = "ratio_vortex"


PREFERENCE = (
    Estimator.DYNAMIC,
    Estimator.TRANSFER_VORTEX,
    Estimator.TRANSFER_ORDER1,
    Estimator.RATIO_VORTEX,
    Estimator.RATIO_ORDER1,
)
"""`dynamic` needs no line and is blind to runout; the vortex is off the harmonics, where runout is;
equation (5) includes damping and grows with bearing noise."""


MAX_SLOW_ROLL_FRACTION = 0.25
"""Share of the rated speed up to which unbalance forces (under 1/16) leave the surface alone."""


@dataclass(frozen=True)
class SlowRollVector:
    """What one probe read at 1× at slow roll.

    Parameters
    ----------
    probe
        Serial number or mark of the probe; another probe, or this one moved, sees another surface.
    phasor_um_pk
        Displacement along the axis, relative to the mark on the shaft: its phase is that of the
        reading when the mark passes the key-phase pick-up.
    taken_ns
        UTC.
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
    response
        How the transducer changes the signal with frequency; none if it does not.
    delay_s
        What the channel is read late by, against the others.
    line_floor
        Amplitude of a line, 0-to-peak in the channel's unit, that the transducer's own noise has.
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


@dataclass(frozen=True)
class GapAccuracy:
    """How well gaps are known: half-widths of uniform distributions (GUM, 4.3.7).

    Parameters
    ----------
    gain
        Relative, of the change of a gap since its reference was read.
    reference_um
        Of a reference gap.
    growth_um
        Of thermal growth that was never measured.
    growth_change_um
        By which growth may have changed since it was last measured.
    growth_asymmetry_um
        By which growth along one axis may differ from that along the other.
    clearance
        Relative, of the radial clearance.
    """

    gain: float = 0.05
    reference_um: float = 5.0
    growth_um: float = 50.0
    growth_change_um: float = 20.0
    growth_asymmetry_um: float = 10.0
    clearance: float = 0.05

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 <= value < math.inf:
                raise ValueError(f"{name} must be a half-width of zero or more, got {value}")


@dataclass(frozen=True)
class BearingAccuracy:
    """How well a bearing's transducers and bracket are known: half-widths, uniform, as shares.

    Parameters
    ----------
    shaft_gain
        Class of the proximity probes, target material and mounting included.
    bearing_gain
        Class of the accelerometers or velocity transducers.
    bracket_stiffness
        Of the k_b that was measured or calculated.
    bracket_mass
        Of the mass, where one is given.
    bracket_damping
        Of the bracket, as a share of critical damping. Bolted and welded steel at working stress
        has 0.02 to 0.03 (Newmark and Hall 1982, table 1).
    delay_s
        Of the delay between shaft and bearing channels, in s. Converters that sample together and
        have the same filters stay within a tenth of a sample at 600 Hz.
    cross_coupling
        Cross-coupled over direct dynamic stiffness of the film, where it is not known: 0.33 to 1.11
        in Brito et al., Table 4.
    probe_noise
        Of the noise density that is taken off the shaft spectra.
    """

    shaft_gain: float = 0.05
    bearing_gain: float = 0.05
    bracket_stiffness: float = 0.10
    bracket_mass: float = 0.2
    bracket_damping: float = 0.02
    delay_s: float = 2e-4
    cross_coupling: float = 0.3
    probe_noise: float = 0.2

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 <= value < 1.0:
                raise ValueError(f"{name} must be a half-width from 0 to below 1, got {value}")


@dataclass(frozen=True)
class Bearing:
    """A guide bearing with two shaft and two bearing channels, named by channel id.

    Parameters
    ----------
    bracket_stiffness_n_per_m
        Radial stiffness k_b of the bracket that holds the bearing.
    clearance_um
        Radial assembled clearance in operation: the radius in which the shaft centre can move.
    gap_reference_um
        Probe gaps (x, y) with the shaft centred.
    oil_temperature, gap_x, gap_y
        Slow channel ids, where measured. Without slow gap channels the mean of the shaft channels
        is the gap.
    opposite_x, opposite_y
        Probes across the shaft from `shaft_x` and `shaft_y`, by channel id, where there are any.
    opposite_gap_x, opposite_gap_y
        Their slow gap channels, where measured.
    opposite_reference_um
        Their gaps (x, y) with the shaft centred.
    bracket_mass_kg
        Effective mass of the bracket; None if not known: `dynamic` then fits it with the film.
        Equation (5) leaves it out, the other estimators take it in.
    bracket_damping_n_s_per_m
        Damping of the bracket; zero where not known.
    runout_um_pk
        Largest runout of the shaft's surface at 1×, as far as it is not taken off.
    gap_accuracy
        How well gaps, references, thermal growth and clearance are known.
    accuracy
        How well transducers and bracket are known.
    preference
        Which estimators `stiffness` is taken from, best first.
    """

    id: str
    bracket_stiffness_n_per_m: float
    shaft_x: str
    shaft_y: str
    bearing_x: str
    bearing_y: str
    clearance_um: float
    gap_reference_um: tuple[float, float]
    oil_temperature: str | None = None
    gap_x: str | None = None
    gap_y: str | None = None
    opposite_x: str | None = None
    opposite_y: str | None = None
    opposite_gap_x: str | None = None
    opposite_gap_y: str | None = None
    opposite_reference_um: tuple[float, float] | None = None
    bracket_mass_kg: float | None = None
    bracket_damping_n_s_per_m: float = 0.0
    runout_um_pk: float = 0.0
    gap_accuracy: GapAccuracy = field(default_factory=GapAccuracy)
    accuracy: BearingAccuracy = field(default_factory=BearingAccuracy)
    preference: tuple[Estimator, ...] = PREFERENCE

    @property
    def bracket(self) -> BracketDynamics:
        """The bracket as a spring that force is read from."""
        return BracketDynamics(
            self.bracket_stiffness_n_per_m, self.bracket_mass_kg, self.bracket_damping_n_s_per_m
        )

    @property
    def channels(self) -> tuple[str, str, str, str]:
        """Channel ids in the order of every matrix in padwatch: u_x, u_y, v_x, v_y."""
        return (self.shaft_x, self.shaft_y, self.bearing_x, self.bearing_y)


@dataclass(frozen=True)
class Unit:
    """A generating unit: its waveform channels in wire order and its bearings.

    Parameters
    ----------
    rotation_sense
        +1 if the shaft turns from x to y, -1 if it turns from y to x.
    has_vortex
        Whether a part-load vortex can occur: in Francis turbines, not in Kaplan turbines.
    key_phase
        Waveform channel with one pulse a turn, where there is one.
    rated_power_mw
        What changes of load are compared with; None if it is not known.
    """

    id: str
    rated_speed_rpm: float
    rate_hz: float
    channels: tuple[Channel, ...]
    bearings: tuple[Bearing, ...]
    speed_channel: str | None = None
    power_channel: str | None = None
    rotation_sense: int = 1
    has_vortex: bool = True
    key_phase: str | None = None
    rated_power_mw: float | None = None
