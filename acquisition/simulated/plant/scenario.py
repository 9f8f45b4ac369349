"""Scenario of a simulated unit: films, excitation, transducers; and courses of scenarios."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

from acquisition.simulated.plant.faults import Fault
from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.rotor import ForcePlane, RotorParameters
from core.machine.response import Response


@dataclass(frozen=True)
class BearingScenario:
    """Oil film of a bearing and position of the shaft in it.

    Parameters
    ----------
    centre_x_um, centre_y_um
        Mean position of the shaft centre from the bearing centre.
    centre_wander_um_rms
        Slow wander of that position, in each direction.
    gap_growth_um, gap_growth_wander_um_rms
        Growth common to all gaps of the bearing, relative to the centred shaft at reference
        temperature, and its slow wander; positive where the housing grows more than the shaft.
    runout_um_pk
        Runout of the shaft under the probes, 1×, 2×, …: phasors at the x probe, locked to the
        shaft; the other probes see the same surface later. Positive is towards the probe.
    bracket_stiffness_factor
        True stiffness of the bracket over that of `Scenario.rotor`, which monitors use.
    position_error_um
        False displacement (x, y) in the gaps, before the gain of the probes: probe drift. It does
        not affect the film.
    oil_temperature_error_c
        Error of the thermometer; positive reads high.
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
        Force in each direction.
    cutoff_hz
        Upper limit of the flat spectrum, which falls steeply above; None is white up to half the
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
class KeyPhasePulse:
    """Pulse of a key-phase pick-up, once a turn.

    Parameters
    ----------
    mark_turns
        Angle from the passage of the mark to the zero that unbalance and runout count from.
    height_v
        Above `rest_v`, or below it on a channel whose direction is -1.
    """

    width_turns: float = 6.0 / 360.0
    mark_turns: float = 0.0
    rest_v: float = 0.5
    height_v: float = 5.0


@dataclass(frozen=True)
class TransducerNoise:
    """Noise of each kind of transducer.

    Parameters
    ----------
    gap_um_rms, displacement_um_rms, velocity_mm_s_rms, acceleration_m_s2_rms, key_phase_v_rms
        White noise over the whole band, added behind the transducer's frequency response.
    accelerometer_g_per_sqrt_hz
        One-sided density of the accelerometers' own noise, before their response; a velocity
        channel is an accelerometer whose charge amplifier integrates.
    accelerometer_corner_hz
        Corner below which the power rises as 1/f; at the corner it is twice that of the density.
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
    """True properties of one transducer, which may differ from the configured ones.

    Parameters
    ----------
    response
        Complex response; None is flat. Must be a model, not a table.
    gain
        True sensitivity over the nominal one. A probe's reference gap was read with the probe
        itself, so the gain acts on the difference from it.
    runout_um_pk
        Runout seen by this probe only, added to that of the shaft, 1×, 2×, …: phasors of motion
        along its axis.
    """

    response: Response | None = None
    gain: float = 1.0
    runout_um_pk: tuple[complex, ...] = ()
    faults: tuple[Fault, ...] = ()


@dataclass(frozen=True)
class Scenario:
    """One unit in steady operation; also the `Course` that stays there.

    Parameters
    ----------
    bearings
        One for each bracket of `rotor`, by bearing.
    unbalance_grade_mm_s
        ISO grade at 92.3 r/min, as in the paper: G4.25 is 75.6 kN there.
    wander_time_s
        Time constant of the wander of shaft centres, temperatures, power and speed.
    speed_wander
        Largest relative deviation of the running speed from `speed_rpm`; 0.003 is 0.3 %. Film and
        gyroscopic forces remain those of `speed_rpm`.
    channels
        Imperfect transducers, by channel.
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
        """Rotor on brackets of their true stiffness."""
        factors = {id_: bearing.bracket_stiffness_factor for id_, bearing in self.bearings.items()}
        brackets = tuple(
            replace(b, stiffness_n_per_m=factors.get(b.bearing, 1.0) * b.stiffness_n_per_m)
            for b in self.rotor.brackets
        )
        return replace(self.rotor, brackets=brackets)

    @property
    def rated_speed_rpm(self) -> float:
        """Speed of the scenario."""
        return self.speed_rpm

    def at(self, elapsed_s: float) -> "Scenario":  # noqa: ARG002  steady operation
        """Return this scenario."""
        return self

    def channel(self, id_: str) -> ChannelScenario:
        """Transducer of a channel; a perfect one by default."""
        return self.channels.get(id_, ChannelScenario())


class Course(Protocol):
    """Sequence of scenarios over time.

    Films, brackets, forces, speed and the fields of `Conditions` may change between two scenarios;
    everything else keeps its initial value. The unit interpolates linearly, its films in steps.
    """

    @property
    def rated_speed_rpm(self) -> float:
        """Usual speed of the unit, above zero."""
        ...

    def at(self, elapsed_s: float) -> Scenario:
        """Scenario at a time after the first sample; times of successive calls rise."""
        ...
