"""Description of a generating unit: channels, bearings, brackets, and accuracies of its data."""

import math
from dataclasses import dataclass, field, fields
from enum import StrEnum

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.machine.channel import Channel, SlowChannel


class Estimator(StrEnum):
    """Estimator of the oil-film stiffness. The names appear in settings, API and database.

    `dynamic` fits the film to broadband vibration. `transfer` and `ratio` use one spectral line, 1×
    or vortex: `transfer` the H1 transfer function, `ratio` the amplitudes in equation (5) of Brito
    et al.
    """

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
"""Estimators in the default order of preference. `dynamic` needs no line, and neither `dynamic` nor
the vortex line contains runout. Equation (5) (`ratio`) includes damping and is biased upwards by
noise of the bearing transducer."""


MIN_NATURAL_HZ = 15.0
"""Lowest natural frequency assumed for a bracket; Brito et al., Table 1, give 24 to 26 Hz."""


@dataclass(frozen=True)
class BracketDynamics:
    """Isotropic spring, effective mass and damper between bearing and foundation.

    The inertia of an unknown mass (None) is neglected. Structural damping is usually unknown and
    set to zero.
    """

    stiffness_n_per_m: float
    mass_kg: float | None = None
    damping_n_s_per_m: float = 0.0

    @property
    def max_mass_kg(self) -> float:
        """Bracket mass or, if unknown, the mass with natural frequency `MIN_NATURAL_HZ`."""
        if self.mass_kg is not None:
            return self.mass_kg
        return self.stiffness_n_per_m / (2.0 * math.pi * MIN_NATURAL_HZ) ** 2

    def dynamic_stiffness_n_per_m(self, frequency_hz: FloatArray) -> ComplexArray:
        """Return the film force per absolute displacement of the bracket in N/m, (n_lines,).

        ``k_b - m_b ω² + iω c_b``: the bracket's row of Brito et al., equation (6), which does not
        contain the forces on the rotor.
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
    """Accuracy of the probe gaps: half-widths of uniform distributions (GUM, 4.3.7).

    Parameters
    ----------
    gain
        Relative error of a gap change since the reference gap was read.
    reference_um
        Error of a reference gap.
    growth_um
        Largest thermal growth of a gap if it was never measured.
    growth_change_um
        Largest change of thermal growth since its last measurement.
    growth_asymmetry_um
        Largest difference of thermal growth between the two axes.
    clearance
        Relative error of the radial clearance.
    """

    gain: float = 0.05
    reference_um: float = 5.0
    growth_um: float = 50.0
    growth_change_um: float = 20.0
    growth_asymmetry_um: float = 10.0
    clearance: float = 0.05


@dataclass(frozen=True)
class BearingAccuracy:
    """Accuracy of a bearing's transducers and bracket: half-widths of uniform distributions.

    Parameters
    ----------
    shaft_gain
        Relative gain error of the proximity probes, including target material and mounting.
    bearing_gain
        Relative gain error of the accelerometers or velocity transducers.
    bracket_stiffness
        Relative error of the measured or calculated stiffness k_b.
    bracket_mass
        Relative error of the mass, if it is given.
    bracket_damping
        Error of the bracket's damping, as a fraction of critical damping. Bolted and welded steel
        at working stress has 0.02 to 0.03 (Newmark and Hall 1982, table 1).
    delay_s
        Error of the delay between shaft and bearing channels, s. Simultaneously sampling converters
        with the same filters stay within a tenth of a sample at 600 Hz.
    cross_coupling
        Cross-coupled over direct dynamic stiffness of the film, if unknown: 0.33 to 1.11 in Brito
        et al., Table 4.
    probe_noise
        Relative error of the noise density that is subtracted from the shaft spectra.
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
    """Guide bearing with two channels for shaft and two for bearing vibration, given by id.

    Parameters
    ----------
    bracket_stiffness_n_per_m
        Radial stiffness k_b of the bracket that holds the bearing; None if unknown. Coefficients
        are then reported as ratios to k_b (`core.stiffness.estimators`).
    clearance_um
        Radial assembled clearance in operation: the radius within which the shaft centre moves.
    gap_reference_um, opposite_reference_um
        Gaps (x, y) of the probes and of the opposite probes with the shaft centred; None without
        opposite probes.
    oil_temperature, gap_x, gap_y, opposite_gap_x, opposite_gap_y
        Ids of the slow channels; None if not measured. Without slow gap channels, the mean of the
        shaft channels is the gap.
    opposite_x, opposite_y
        Channel ids of the probes opposite `shaft_x` and `shaft_y`, if installed.
    bracket_mass_kg
        Effective mass of the bracket; None if unknown. `Estimator.DYNAMIC` then fits it with the
        film. Equation (5) neglects it; the other estimators include it.
    runout_um_pk
        Largest shaft runout at 1× that is not subtracted as a slow-roll vector.
    preference
        Estimators from which `stiffness` is chosen, in order of preference.
    """

    id: str
    bracket_stiffness_n_per_m: float | None
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
        """Stiffness, mass and damping of the bracket, from which the film force is derived.

        An unknown stiffness is replaced by 1 N/m; film coefficients are then ratios to it.
        """
        stiffness = self.bracket_stiffness_n_per_m
        if stiffness is None:
            return BracketDynamics(1.0)
        return BracketDynamics(stiffness, self.bracket_mass_kg, self.bracket_damping_n_s_per_m)

    @property
    def channels(self) -> tuple[str, str, str, str]:
        """Channel ids in the order of all matrices: shaft u_x, u_y, then bearing v_x, v_y."""
        return (self.shaft_x, self.shaft_y, self.bearing_x, self.bearing_y)


@dataclass(frozen=True)
class Unit:
    """Generating unit: its waveform channels in the order of the device, and its bearings.

    Parameters
    ----------
    rate_hz
        Sampling rate of each channel; for a monitoring rack, the rate of the polls.
    speed_channel, power_channel
        Ids of the slow channels of speed and active power; None if not measured.
    rotation_sense
        +1 if the shaft turns from x to y, -1 if it turns from y to x.
    has_vortex
        Whether a part-load vortex can occur: in Francis turbines, not in Kaplan turbines.
    key_phase
        Id of the waveform channel with one pulse per turn; None if not installed.
    rated_power_mw
        Rated power, the reference of relative load changes; None if unknown.
    slow_channels
        Slow channels that are recorded beside the vibration.
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
    slow_channels: tuple[SlowChannel, ...] = ()

    def slow_channels_of(self, bearing: str) -> list[SlowChannel]:
        """Return the slow channels recorded with a bearing: its own and those of the unit."""
        return [c for c in self.slow_channels if c.bearing in (None, bearing)]


def require_same_machine(here: Unit, there: Unit) -> None:
    """Check that two descriptions of a unit agree in all fields that cannot change while it runs.

    Only the data of the bearings may differ, such as gap references, clearances and brackets; their
    ids and channels must agree.

    Raises ValueError if another field differs; the message gives its name and both values.
    """
    before, after = _fixed_parts(here), _fixed_parts(there)
    for name, value in before.items():
        if after[name] != value:
            raise ValueError(f"{name} is {after[name]!r}, expected {value!r}: it must not change")


def bearings_with_new_references(here: Unit, there: Unit) -> list[str]:
    """Return the ids of bearings whose gap references differ; both units have the same bearings."""
    pairs = zip(here.bearings, there.bearings, strict=True)
    return [
        b.id
        for b, new in pairs
        if (b.gap_reference_um, b.opposite_reference_um)
        != (new.gap_reference_um, new.opposite_reference_um)
    ]


def _fixed_parts(unit: Unit) -> dict[str, object]:
    """Return the fields of a unit that cannot change while it is monitored, by name."""
    fixed: dict[str, object] = {field.name: getattr(unit, field.name) for field in fields(unit)}
    return fixed | {"bearings": tuple((b.id, b.channels) for b in unit.bearings)}
