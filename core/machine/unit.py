"""The unit as the numerics see it: which channel measures what, on which bearing."""

import math
from dataclasses import dataclass, field, fields
from enum import StrEnum

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.machine.channel import Channel


class Estimator(StrEnum):
    """Estimators of stiffness. The names appear in settings, API and store."""

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


MIN_NATURAL_HZ = 15.0
"""Lowest natural frequency of a bracket; those of Brito et al., Table 1, have 24 to 26 Hz."""


@dataclass(frozen=True)
class BracketDynamics:
    """Isotropic spring, effective mass and damper between bearing and foundation.

    An unknown mass leaves the inertia out; structural damping is usually not known and zero.
    """

    stiffness_n_per_m: float
    mass_kg: float | None = None
    damping_n_s_per_m: float = 0.0

    @property
    def max_mass_kg(self) -> float:
        """The mass, or the largest that a bracket of that stiffness can have."""
        if self.mass_kg is not None:
            return self.mass_kg
        return self.stiffness_n_per_m / (2.0 * math.pi * MIN_NATURAL_HZ) ** 2

    def dynamic_stiffness_n_per_m(self, frequency_hz: FloatArray) -> ComplexArray:
        """Force that the film exerts per absolute displacement of the bracket, (n_lines,).

        ``k_b - m_b ω² + iω c_b``: the bracket's row of Brito et al., equation (6), in which the
        forces on the rotor do not appear.
        """
        omega = 2.0 * np.pi * frequency_hz
        stiffness: ComplexArray = (
            self.stiffness_n_per_m
            - (self.mass_kg or 0.0) * omega**2
            + 1j * omega * self.damping_n_s_per_m
        )
        return stiffness


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


@dataclass(frozen=True)
class Bearing:
    """A guide bearing with two shaft and two bearing channels, named by channel id.

    Parameters
    ----------
    bracket_stiffness_n_per_m
        Radial stiffness k_b of the bracket that holds the bearing.
    clearance_um
        Radial assembled clearance in operation: the radius in which the shaft centre can move.
    gap_reference_um, opposite_reference_um
        Gaps (x, y) of the probes and of the opposite probes with the shaft centred.
    oil_temperature, gap_x, gap_y, opposite_gap_x, opposite_gap_y
        Slow channel ids, where measured. Without slow gap channels the mean of the shaft channels
        is the gap.
    opposite_x, opposite_y
        Probes across the shaft from `shaft_x` and `shaft_y`, by channel id, where there are any.
    bracket_mass_kg
        Effective mass of the bracket; None if not known: `dynamic` then fits it with the film.
        Equation (5) leaves it out, the other estimators take it in.
    runout_um_pk
        Largest runout of the shaft's surface at 1×, as far as it is not taken off.
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
        Rated power, which changes of load are compared with; None if not known.
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


def require_same_machine(here: Unit, there: Unit) -> None:
    """Refuse a description that differs in more than references, clearances and brackets.

    Raises
    ------
    ValueError
        With the name of the first field that differs, and both values.
    """
    before, after = _fixed_parts(here), _fixed_parts(there)
    for name, value in before.items():
        if after[name] != value:
            raise ValueError(f"{name} is {after[name]!r}, is {value!r} here")


def bearings_with_new_references(here: Unit, there: Unit) -> list[str]:
    """Ids of the bearings whose gap references differ."""
    pairs = zip(here.bearings, there.bearings, strict=True)
    return [
        b.id
        for b, new in pairs
        if (b.gap_reference_um, b.opposite_reference_um)
        != (new.gap_reference_um, new.opposite_reference_um)
    ]


def _fixed_parts(unit: Unit) -> dict[str, object]:
    """The fields that cannot change while the unit is monitored, by name."""
    fixed: dict[str, object] = {field.name: getattr(unit, field.name) for field in fields(unit)}
    return fixed | {"bearings": tuple((b.id, b.channels) for b in unit.bearings)}
