"""What goes wrong with a bearing or its transducers, and how it grows."""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from core.arrays import FloatArray, TimeArray
from core.baseline.history import DIRECTIONS
from core.units import NS_PER_S


class DamageKind(StrEnum):
    """What goes wrong. In films the first four, then what only looks like it, or not even that."""

    STIFFNESS_LOSS = "stiffness_loss"
    CLEARANCE_GROWTH = "clearance_growth"
    PIVOT_WEAR = "pivot_wear"
    OIL_DEGRADATION = "oil_degradation"
    BRACKET_LOOSENING = "bracket_loosening"
    PROBE_GAIN = "probe_gain"
    ACCELEROMETER_GAIN = "accelerometer_gain"


GAINS = frozenset({DamageKind.PROBE_GAIN, DamageKind.ACCELEROMETER_GAIN})


@dataclass(frozen=True)
class Damage:
    """One damage of one bearing.

    Parameters
    ----------
    size
        Share that is lost in the end: of the film's stiffness (a step of all pads; growing
        clearance, with the shaft following the pads), of the viscosity, of the bracket's
        stiffness. For a pivot, by how much its pad recedes, over the clearance told. For a gain its
        relative change, with its sign: -0.2 loses a fifth.
    ramp_days
        Time from onset to `size`, evenly; 0 is a step.
    directions
        Whose transducers change, for gains.

    Raises
    ------
    ValueError
        If size, ramp or directions make no sense; with key and value.
    """

    kind: DamageKind
    bearing: str
    onset_ns: int
    size: float
    ramp_days: float = 0.0
    directions: tuple[str, ...] = field(default=DIRECTIONS)

    def __post_init__(self) -> None:
        least = -1.0 if self.kind in GAINS else 0.0
        if not (least < self.size < 1.0 and self.size != 0.0):
            raise ValueError(
                f"size = {self.size:g} of {self.kind} must lie between {least:g} and 1"
            )
        if not self.ramp_days >= 0.0:
            raise ValueError(f"ramp_days = {self.ramp_days:g} must be 0 or more")
        if not self.directions or not set(self.directions) <= set(DIRECTIONS):
            raise ValueError(f"directions = {self.directions} must be of {DIRECTIONS}")

    def extent(self, time_ns: TimeArray) -> FloatArray:
        """(n,) part of `size` that is reached."""
        since_days = (time_ns - self.onset_ns) / (86_400.0 * NS_PER_S)
        if self.ramp_days == 0.0:
            return (since_days >= 0.0).astype(np.float64)
        return np.clip(since_days / self.ramp_days, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Alteration:
    """What damage has done to one bearing; factors and lengths, 1 and 0 where nothing.

    Parameters
    ----------
    stiffness, clearance, viscosity, bracket : (n,)
        Factors.
    pivot_share : (n,)
        By which the pad nearest the shaft has receded, over the clearance told.
    probe_gain, accelerometer_gain : (2, n)
        Factors, x and y.
    """

    stiffness: FloatArray
    clearance: FloatArray
    viscosity: FloatArray
    bracket: FloatArray
    pivot_share: FloatArray
    probe_gain: FloatArray
    accelerometer_gain: FloatArray


def alteration(damage: tuple[Damage, ...], bearing: str, time_ns: TimeArray) -> Alteration:
    """Gather what all damage does to one bearing."""
    lost = {
        kind: sum(
            (d.size * d.extent(time_ns) for d in damage if d.bearing == bearing and d.kind is kind),
            np.zeros(time_ns.size),
        )
        for kind in set(DamageKind) - GAINS
    }
    return Alteration(
        stiffness=1.0 - lost[DamageKind.STIFFNESS_LOSS],
        clearance=(1.0 - lost[DamageKind.CLEARANCE_GROWTH]) ** (-1.0 / 3.0),  # k ∝ 1/c³
        viscosity=1.0 - lost[DamageKind.OIL_DEGRADATION],
        bracket=1.0 - lost[DamageKind.BRACKET_LOOSENING],
        pivot_share=lost[DamageKind.PIVOT_WEAR],
        probe_gain=_gain(damage, bearing, DamageKind.PROBE_GAIN, time_ns),
        accelerometer_gain=_gain(damage, bearing, DamageKind.ACCELEROMETER_GAIN, time_ns),
    )


def _gain(
    damage: tuple[Damage, ...], bearing: str, kind: DamageKind, time_ns: TimeArray
) -> FloatArray:
    gain = np.ones((2, time_ns.size))
    for d in damage:
        if d.bearing == bearing and d.kind is kind:
            for direction in d.directions:
                gain[DIRECTIONS.index(direction)] *= 1.0 + d.size * d.extent(time_ns)
    return gain
