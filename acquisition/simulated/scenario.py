"""What a simulated unit goes through: its films, what shakes it, how well it is measured."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from core.film import Film
from core.rotor_parameters import ForcePlane, RotorParameters


@dataclass(frozen=True)
class BearingScenario:
    """One bearing: its oil film and where the shaft sits in it.

    Parameters
    ----------
    centre_x_um, centre_y_um
        Mean position of the shaft centre from the bearing centre.
    centre_wander_um_rms
        Slow wander of that position, for each direction.
    """

    film: Film
    centre_x_um: float = 0.0
    centre_y_um: float = 0.0
    centre_wander_um_rms: float = 0.0
    oil_temperature_c: float = 45.0
    oil_temperature_wander_c_rms: float = 0.0


@dataclass(frozen=True)
class HydraulicNoise:
    """Broadband hydraulic force on the rotor, Gaussian, independent in x and y.

    Parameters
    ----------
    rms_n
        Of the force in each direction.
    cutoff_hz
        The spectrum is flat below and falls steeply above; ``None`` is white up to half the
        sampling rate.
    """

    rms_n: float = 0.0
    cutoff_hz: float | None = None
    plane: ForcePlane = ForcePlane.RUNNER


@dataclass(frozen=True)
class VortexRope:
    """Rotating force of the part-load vortex on the runner; not locked to the shaft.

    Parameters
    ----------
    order
        Mean frequency as a multiple of the running speed; nominally 0.25.
    line_width_hz
        Width of the line at half its power: how fast the phase wanders.
    """

    force_n: float = 0.0
    order: float = 0.25
    line_width_hz: float = 0.002


@dataclass(frozen=True)
class TransducerNoise:
    """White noise of each kind of transducer over the whole band, rms."""

    gap_um_rms: float = 0.0
    displacement_um_rms: float = 0.0
    velocity_mm_s_rms: float = 0.0
    acceleration_m_s2_rms: float = 0.0


@dataclass(frozen=True)
class Scenario:
    """One unit in steady operation.

    Parameters
    ----------
    bearings
        One for each bracket of `rotor`, by bearing.
    unbalance_grade_mm_s
        ISO grade at 92.3 r/min, as in the paper: G4.25 is 75.6 kN there.
    wander_time_s
        How slowly shaft centres, temperatures and power wander.
    """

    bearings: Mapping[str, BearingScenario]
    speed_rpm: float = 92.3
    active_power_mw: float = 700.0
    active_power_wander_mw_rms: float = 0.0
    unbalance_grade_mm_s: float = 4.25
    hydraulic: HydraulicNoise = field(default_factory=HydraulicNoise)
    rope: VortexRope = field(default_factory=VortexRope)
    noise: TransducerNoise = field(default_factory=TransducerNoise)
    wander_time_s: float = 600.0
    rotor: RotorParameters = field(default_factory=RotorParameters)
