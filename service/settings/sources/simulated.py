"""Settings of simulated machines: signals, machine lives and damage."""

from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, model_validator

from service.settings.base import MisfitError, MissingError, Settings, refuse_twice


class SimulatedDamageSettings(Settings):
    """Damage to one bearing of a simulated machine."""

    bearing: Literal["UJB", "LJB", "TJB"]
    """Name of the damaged bearing in the rotor model."""

    kind: Literal[
        "stiffness_loss",
        "clearance_growth",
        "pivot_wear",
        "oil_degradation",
        "bracket_loosening",
        "probe_gain",
        "accelerometer_gain",
    ]
    """Kind of damage: to the film (the first four kinds), the bracket or the transducers."""

    size: Annotated[float, Field(gt=-1.0, lt=1.0)]
    """Final relative loss of film stiffness, oil viscosity or bracket stiffness, or final relative
    change of a transducer gain, with sign. Example: 0.2."""

    after_s: Annotated[float, Field(ge=0.0, le=3.2e7)] | None = None
    """Onset of the damage after the start of the simulator, s."""

    at: AwareDatetime | None = None
    """Onset of the damage as an absolute time, instead of after_s. Example:
    2026-03-01T12:00:00Z."""

    ramp_s: Annotated[float, Field(ge=0.0, le=3.2e7)] = 0.0
    """Duration of the linear increase of the damage to `size`, s; 0 is a step."""

    directions: Annotated[tuple[Literal["x", "y"], ...], Field(min_length=1)] = ("x", "y")
    """Directions of the transducers with a changed gain; only for gains."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.after_s is None) == (self.at is None):
            raise MisfitError("exactly one of after_s and at must be given")
        if self.size == 0.0 or (self.size < 0.0 and not self.kind.endswith("_gain")):
            raise MisfitError("must be above 0, or not 0 for a gain", "size")
        return self


class SimulatedLifeSettings(Settings):
    """Settings of a machine life, the simulated history and future operation of a machine."""

    life_seed: Annotated[int, Field(ge=0, le=2**63 - 1)] | None = None
    """Seed of a machine life, instead of constant films. The speed is 92.3 r/min for an even seed
    and 90.9 r/min for an odd seed. The seed determines starts and stops, load, oil temperature and
    shaft position."""

    held_load: Annotated[float, Field(gt=0.0, le=1.0)] | None = None
    """Constant load as a fraction of 700 MW, from the day before the start of the simulator; by
    default the load varies and the machine may be stopped. Example: 0.95."""

    damage: tuple[SimulatedDamageSettings, ...] = ()
    """Damage to the bearings of the machine."""


class SimulatedBearingSettings(Settings):
    """Settings of the oil film and shaft position of one simulated bearing."""

    bearing: Literal["UJB", "LJB", "TJB"]
    """Name of the bearing in the rotor model."""

    k_xx_n_per_m: Annotated[float, Field(ge=1e6, le=1e12)]
    """Direct film stiffness in x, N/m; the film damping is 0.0125 s times the stiffness. Example:
    0.69e9."""

    k_yy_n_per_m: Annotated[float, Field(ge=1e6, le=1e12)]
    """Direct film stiffness in y, N/m."""

    k_cross_n_per_m: Annotated[float, Field(ge=-1e12, le=1e12)] = 0.0
    """Cross-coupled film stiffness k_xy = k_yx, N/m."""

    centre_x_um: Annotated[float, Field(ge=-5000.0, le=5000.0)] = 0.0
    """Mean position of the shaft centre in x, µm."""

    centre_y_um: Annotated[float, Field(ge=-5000.0, le=5000.0)] = 0.0
    """Mean position of the shaft centre in y, µm."""

    centre_wander_um_rms: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.0
    """Slow random variation of the shaft centre in each direction, µm rms."""

    oil_temperature_c: Annotated[float, Field(ge=0.0, le=120.0)] = 45.0
    """Mean oil temperature, °C."""

    oil_temperature_wander_c_rms: Annotated[float, Field(ge=0.0, le=20.0)] = 0.0
    """Slow random variation of the oil temperature, K rms."""


OF_A_LIFE = ("held_load", "damage")
"""Keys that require `life_seed`."""

FIXED = (
    *("speed_rpm", "power_mw", "power_wander_mw_rms", "unbalance_grade_mm_s", "bearing"),
    *("hydraulic_force_n_rms", "hydraulic_cutoff_hz", "rope_force_n", "rope_order"),
)
"""Keys that are not allowed with `life_seed`."""

NEEDED = ("speed_rpm", "power_mw", "bearing")
"""Keys that are required without `life_seed`."""


class SimulationSettings(SimulatedLifeSettings):
    """Settings of a simulated machine on the ten-degree-of-freedom model of Brito et al.

    The machine has either constant films or a machine life.
    """

    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 1
    """Seed of the random signals; the same seed gives identical samples."""

    speed_rpm: Annotated[float, Field(ge=20.0, le=1500.0)] | None = None
    """Running speed of the machine, r/min."""

    power_mw: Annotated[float, Field(ge=-2000.0, le=2000.0)] | None = None
    """Mean active power of the machine, MW."""

    power_wander_mw_rms: Annotated[float, Field(ge=0.0, le=200.0)] = 0.0
    """Slow random variation of the active power, MW rms."""

    unbalance_grade_mm_s: Annotated[float, Field(ge=0.0, le=40.0)] = 4.25
    """ISO balance grade G in mm/s; G4.25 is a rotating force of 75.6 kN at 92.3 r/min."""

    hydraulic_force_n_rms: Annotated[float, Field(ge=0.0, le=1e7)] = 0.0
    """Broadband hydraulic force on the runner, N rms in each direction."""

    hydraulic_cutoff_hz: Annotated[float, Field(gt=0.0, le=1000.0)] | None = None
    """Bandwidth of the hydraulic force, Hz; white noise by default."""

    rope_force_n: Annotated[float, Field(ge=0.0, le=1e7)] = 0.0
    """Rotating force of the part-load vortex rope on the runner, N."""

    rope_order: Annotated[float, Field(ge=0.1, le=0.9)] = 0.25
    """Mean frequency of the vortex rope in multiples of the running speed."""

    gap_noise_um_rms: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0
    """White noise of the proximity probe channels, µm rms."""

    velocity_noise_mm_s_rms: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0
    """White noise of the velocity channels, mm/s rms."""

    acceleration_noise_m_s2_rms: Annotated[float, Field(ge=0.0, le=100.0)] = 0.0
    """White noise of the acceleration channels, m/s² rms."""

    samples_per_slot: Annotated[int, Field(ge=1, le=4096)] = 50
    """Number of samples per channel in a slot of the simulated DAQ's block ring."""

    n_slots: Annotated[int, Field(ge=2, le=4096)] = 64
    """Number of slots of the simulated DAQ's block ring; at 12 channels at most 64 slots of 50
    samples fit into the registers."""

    bearing: Annotated[tuple[SimulatedBearingSettings, ...], Field(min_length=3, max_length=3)] = ()
    """Settings of the three bearings UJB, LJB and TJB."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for key in FIXED if self.life_seed is not None else OF_A_LIFE:
            if key in self.model_fields_set:
                has_life = self.life_seed is not None
                raise MisfitError(
                    f"applies only {'without' if has_life else 'with'} life_seed; remove it", key
                )
        for key in NEEDED if self.life_seed is None else ():
            if key not in self.model_fields_set:
                raise MissingError("is missing; it is required without life_seed", key)
        refuse_twice(("bearing", n, "bearing", b.bearing) for n, b in enumerate(self.bearing))
        return self
