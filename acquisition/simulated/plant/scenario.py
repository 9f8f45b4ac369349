"""Scenarios of a simulated unit: films, excitation and transducers; courses of scenarios."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

from acquisition.simulated.plant.faults import Fault
from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.rotor import ForcePlane, RotorParameters
from core.machine.response import Response


@dataclass(frozen=True)
class BearingScenario:
    """Oil film, shaft position and measurement errors of one bearing.

    Parameters
    ----------
    centre_x_um, centre_y_um
        Mean position of the shaft centre relative to the bearing centre.
    centre_wander_um_rms
        Slow random variation of the shaft position, in each direction.
    gap_growth_um
        Common growth of all gaps of the bearing, relative to the centred shaft at reference
        temperature; positive if the housing grows more than the shaft.
    gap_growth_wander_um_rms
        Slow random variation of the gap growth.
    runout_um_pk
        Runout of the shaft surface, 1×, 2×, …: phasors at the x probe, locked to the shaft. The
        other probes measure the same surface with a delay. Positive is towards the probe.
    bracket_stiffness_factor
        Ratio of the true bracket stiffness to that of `Scenario.rotor`, which monitors use.
    position_error_um
        Error (x, y) of the displacement in the gaps, before the gain of the probes: probe drift.
        It does not affect the film.
    oil_temperature_error_c
        Error of the thermometer; positive if the reading is too high.
    """

    film: Film
    centre_x_um: float = 0.0
    centre_y_um: float = 0.0
    centre_wander_um_rms: float = 0.0
    oil_temperature_c: float = 45.0
    oil_temperature_wander_c_rms: float = 0.0
    gap_growth_um: float = 0.0
    gap_growth_wander_um_rms: float = 0.0
    runout_um_pk: tuple[complex, ...] = ()
    bracket_stiffness_factor: float = 1.0
    position_error_um: tuple[float, float] = (0.0, 0.0)
    oil_temperature_error_c: float = 0.0


@dataclass(frozen=True)
class HydraulicNoise:
    """Broadband hydraulic force on the rotor, Gaussian, independent in x and y.

    Parameters
    ----------
    rms_n
        Rms of the force in each direction.
    cutoff_hz
        Upper limit of the flat spectrum, with a steep roll-off; None is white noise up to half the
        sampling rate.
    plane
        Plane of the rotor on which the force acts.
    """

    rms_n: float = 0.0
    cutoff_hz: float | None = None
    plane: ForcePlane = ForcePlane.RUNNER


@dataclass(frozen=True)
class VortexRope:
    """Rotating force of the part-load vortex rope on the runner, not locked to the shaft.

    Parameters
    ----------
    force_n
        Amplitude of the force; 0 without vortex rope.
    order
        Mean frequency as a multiple of the running speed; nominally 0.25.
    line_width_hz
        Width of the spectral line at half power, caused by random phase.
    """

    force_n: float = 0.0
    order: float = 0.25
    line_width_hz: float = 0.002


@dataclass(frozen=True)
class KeyPhasePulse:
    """Pulse of a key-phase pick-up, once per turn.

    Parameters
    ----------
    width_turns, mark_turns
        Width of the pulse, and angle from the passage of the mark to the zero angle of unbalance
        and runout, in turns.
    rest_v, height_v
        Voltage between the pulses, and height of a pulse above it (below, if direction is -1).
    """

    width_turns: float = 6.0 / 360.0
    mark_turns: float = 0.0
    rest_v: float = 0.5
    height_v: float = 5.0


@dataclass(frozen=True)
class TransducerNoise:
    """Noise of the transducers, with one parameter for each measurand.

    Parameters
    ----------
    gap_um_rms, displacement_um_rms, velocity_mm_s_rms, acceleration_m_s2_rms, key_phase_v_rms
        White noise over the whole band, added after the frequency response of the transducer.
    accelerometer_g_per_sqrt_hz
        One-sided density of the accelerometer noise, before the frequency response. A velocity
        channel is an accelerometer with an integrating charge amplifier.
    accelerometer_corner_hz
        Corner frequency of the noise: the power rises as 1/f below, and is twice the white noise
        at the corner.
    """

    gap_um_rms: float = 0.0
    displacement_um_rms: float = 0.0
    velocity_mm_s_rms: float = 0.0
    acceleration_m_s2_rms: float = 0.0
    accelerometer_g_per_sqrt_hz: float = 0.0
    accelerometer_corner_hz: float = 2.0
    key_phase_v_rms: float = 0.0


@dataclass(frozen=True)
class ChannelScenario:
    """True properties of one transducer, which may differ from the configuration.

    Parameters
    ----------
    response
        Complex frequency response, given by a model, not by a table; None is flat.
    gain
        Ratio of true to nominal sensitivity. The reference gap of a probe was measured with the
        probe itself, so the gain applies to the difference from the reference gap.
    runout_um_pk
        Additional runout of this probe only, 1×, 2×, …: phasors of motion along its axis.
    faults
        Permanent faults, applied in sequence.
    """

    response: Response | None = None
    gain: float = 1.0
    runout_um_pk: tuple[complex, ...] = ()
    faults: tuple[Fault, ...] = ()


@dataclass(frozen=True)
class Scenario:
    """Simulated conditions of one unit in steady operation; also a `Course` that is constant.

    Parameters
    ----------
    bearings
        Scenario of each bracket of `rotor`, by bearing id.
    unbalance_grade_mm_s
        ISO balance grade at 92.3 r/min as in Brito et al., where G4.25 is 75.6 kN.
    wander_time_s
        Time constant of the random variation of shaft centres, temperatures, power and speed.
    speed_wander
        Maximum relative deviation of the running speed from `speed_rpm`; 0.003 is 0.3 %. Film and
        gyroscopic forces are computed at `speed_rpm`.
    channels
        Transducers that are not ideal, by channel id.
    exchanged
        Pairs of channels with swapped cables.
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
    speed_wander: float = 0.0
    channels: Mapping[str, ChannelScenario] = field(default_factory=dict)
    exchanged: tuple[tuple[str, str], ...] = ()
    key_phase: KeyPhasePulse = field(default_factory=KeyPhasePulse)

    @property
    def true_rotor(self) -> RotorParameters:
        """Rotor with the true stiffness of its brackets."""
        factors = {id_: bearing.bracket_stiffness_factor for id_, bearing in self.bearings.items()}
        brackets = tuple(
            replace(b, stiffness_n_per_m=factors.get(b.bearing, 1.0) * b.stiffness_n_per_m)
            for b in self.rotor.brackets
        )
        return replace(self.rotor, brackets=brackets)

    @property
    def rated_speed_rpm(self) -> float:
        """Rated speed, which is the speed of the scenario."""
        return self.speed_rpm

    def at(self, elapsed_s: float) -> "Scenario":  # noqa: ARG002  steady operation
        """Return this scenario, which is the same at all times."""
        return self

    def channel(self, id_: str) -> ChannelScenario:
        """Return the transducer of a channel; an ideal transducer by default."""
        return self.channels.get(id_, ChannelScenario())


class Course(Protocol):
    """Protocol of a sequence of scenarios of one unit over time.

    Films, brackets, forces, speed and the fields of `Conditions` may change between two scenarios;
    all other values remain those of the first scenario. The unit interpolates linearly between two
    scenarios, the films in small steps.
    """

    @property
    def rated_speed_rpm(self) -> float:
        """Rated speed of the unit, above zero."""
        ...

    def at(self, elapsed_s: float) -> Scenario:
        """Return the scenario at `elapsed_s` seconds after the first sample.

        The time must increase from call to call.
        """
        ...
