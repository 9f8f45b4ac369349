"""Damage of a bearing or of its transducers, and its growth over time."""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from core.arrays import FloatArray, TimeArray
from core.baseline.history import DIRECTIONS
from core.units import NS_PER_S


class DamageKind(StrEnum):
    """Kind of damage: four kinds of the film, one of the bracket, two of the transducers."""

    STIFFNESS_LOSS = "stiffness_loss"
    CLEARANCE_GROWTH = "clearance_growth"
    PIVOT_WEAR = "pivot_wear"
    OIL_DEGRADATION = "oil_degradation"
    BRACKET_LOOSENING = "bracket_loosening"
    PROBE_GAIN = "probe_gain"
    ACCELEROMETER_GAIN = "accelerometer_gain"


GAINS = frozenset({DamageKind.PROBE_GAIN, DamageKind.ACCELEROMETER_GAIN})
SIGNED = GAINS | {DamageKind.OIL_DEGRADATION}


@dataclass(frozen=True)
class Damage:
    """One damage of one bearing.

    Parameters
    ----------
    size
        Final size, by kind. Stiffness loss and clearance growth: relative loss of film stiffness at
        a constant eccentricity ratio. Oil and bracket: relative loss of viscosity and of bracket
        stiffness, negative for a more viscous oil. Pivot wear: recession of the pad divided by the
        configured clearance. Gains: signed relative change, -0.2 is a decrease by 20 %.
    ramp_days
        Duration of the linear growth from 0 to `size`; 0 is a step.
    directions
        Directions of the affected transducers, for gains only.

    Raises
    ------
    ValueError
        If size, ramp or directions are invalid; the message contains name and value.
    """

    kind: DamageKind
    bearing: str
    onset_ns: int
    size: float
    ramp_days: float = 0.0
    directions: tuple[str, ...] = field(default=DIRECTIONS)

    def __post_init__(self) -> None:
        minimum = -1.0 if self.kind in SIGNED else 0.0
        if not (minimum < self.size < 1.0 and self.size != 0.0):
            limits = f"between {minimum:g} and 1, and not 0"
            raise ValueError(f"size = {self.size:g} of {self.kind} must be {limits}")
        if not self.ramp_days >= 0.0:
            raise ValueError(f"ramp_days = {self.ramp_days:g} must be 0 or more")
        if not self.directions or not set(self.directions) <= set(DIRECTIONS):
            found = " and ".join(self.directions) or "none"
            raise ValueError(f"directions must be x, y or both, got {found}")

    def extent(self, time_ns: TimeArray) -> FloatArray:
        """Return the fraction of `size` that the damage has reached, (n,)."""
        since_days = (time_ns - self.onset_ns) / (86_400.0 * NS_PER_S)
        if self.ramp_days == 0.0:
            return (since_days >= 0.0).astype(np.float64)
        return np.clip(since_days / self.ramp_days, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Alteration:
    """Effect of damage on one bearing over time; factors are 1 without damage.

    Parameters
    ----------
    stiffness, clearance, viscosity, bracket : (n,)
        Factors of film stiffness, pad clearance, oil viscosity and bracket stiffness.
    pivot_share : (n,)
        Recession of the worn pad divided by the configured clearance; 0 without damage.
    probe_gain, accelerometer_gain : (2, n)
        Factors of the gains in x and y.
    """

    stiffness: FloatArray
    clearance: FloatArray
    viscosity: FloatArray
    bracket: FloatArray
    pivot_share: FloatArray
    probe_gain: FloatArray
    accelerometer_gain: FloatArray


def alteration(damage: tuple[Damage, ...], bearing: str, time_ns: TimeArray) -> Alteration:
    """Return the joint effect of all damage of one bearing at the times `time_ns`, (n,).

    Losses of the same kind of damage add up; gains multiply.
    """
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
