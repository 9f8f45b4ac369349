"""The machine as the numerics see it: which channel measures what, on which bearing."""

from dataclasses import dataclass
from enum import StrEnum


class Measurand(StrEnum):
    """What a waveform channel measures, and therefore its engineering unit."""

    GAP_UM = "gap_um"
    DISPLACEMENT_UM = "displacement_um"
    VELOCITY_MM_S = "velocity_mm_s"
    ACCELERATION_M_S2 = "acceleration_m_s2"


@dataclass(frozen=True)
class Channel:
    """A waveform channel.

    Parameters
    ----------
    direction
        +1 if a growing reading means motion along the positive bearing axis, -1 if against it. A
        probe mounted on the positive axis sees its gap shrink as the shaft approaches: -1.
    """

    id: str
    measurand: Measurand
    direction: int = 1


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

    @property
    def channels(self) -> tuple[str, str, str, str]:
        """Channel ids in the order of every matrix in padwatch: u_x, u_y, v_x, v_y."""
        return (self.shaft_x, self.shaft_y, self.bearing_x, self.bearing_y)


@dataclass(frozen=True)
class Unit:
    """A generating unit: its waveform channels in wire order and its bearings."""

    id: str
    rated_speed_rpm: float
    rate_hz: float
    channels: tuple[Channel, ...]
    bearings: tuple[Bearing, ...]
    speed_channel: str | None = None
    power_channel: str | None = None
