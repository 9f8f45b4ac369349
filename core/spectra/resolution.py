"""Resolution of the signals of two transducers in any two directions into the bearing axes x and y.

A transducer at the angle θ from x towards y measures ``u_x cos θ + u_y sin θ``; two of them at
different angles give u_x and u_y.
"""

import math

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.machine.unit import Bearing, Unit
from core.quality import Level, Quality, Reason, bad, worst

USUAL_DEG = (0.0, 90.0)
"""Angles of two transducers along x and y."""


def angles_of(first_deg: float | None, second_deg: float | None) -> tuple[float, float]:
    """Return the angles of two transducers in degrees; None stands for 0° (first), 90° (second)."""
    x_deg, y_deg = USUAL_DEG
    return (
        x_deg if first_deg is None else first_deg,
        y_deg if second_deg is None else second_deg,
    )


def resolving_matrix(unit: Unit, first: str, second: str) -> FloatArray | None:
    """Return the matrix (2, 2) from the readings of channels `first` and `second` to x and y.

    None if the channels are at 0° and 90°, along x and y. Parallel channels are not accepted.
    """
    found = {channel.id: channel.angle_deg for channel in unit.channels}
    angles_deg = angles_of(found[first], found[second])
    if angles_deg == USUAL_DEG:
        return None
    theta = np.deg2rad(angles_deg)
    return np.linalg.inv(np.stack([np.cos(theta), np.sin(theta)], axis=1))


def shaft_matrix(unit: Unit, bearing: Bearing) -> FloatArray | None:
    """Return the matrix (2, 2) from a bearing's shaft probes to x and y; None if along x and y."""
    return resolving_matrix(unit, bearing.shaft_x, bearing.shaft_y)


def error_factor(between_deg: float) -> float:
    """Return the largest factor from errors of two transducers to errors in x and y.

    `between_deg` is the angle between the transducers; the factor is 1 at 90°.
    """
    return 1.0 / math.sqrt(1.0 - abs(round(math.cos(math.radians(between_deg)), 12)))


class Resolution:
    """Resolution of all channels of a unit into x and y; channels along x or y are unchanged."""

    def __init__(self, unit: Unit) -> None:
        row_of = {channel.id: row for row, channel in enumerate(unit.channels)}
        ids = [pair for b in unit.bearings for pair in (b.channels[:2], b.channels[2:])]
        found = [([row_of[one], row_of[two]], resolving_matrix(unit, one, two)) for one, two in ids]
        self._pairs = [(rows, matrix) for rows, matrix in found if matrix is not None]

    def phasors(self, phasors: ComplexArray) -> ComplexArray:
        """Return displacement phasors (n_channels, …), resolved along x and y."""
        resolved = phasors.copy() if self._pairs else phasors
        for rows, matrix in self._pairs:
            resolved[rows] = np.tensordot(matrix, phasors[rows], axes=1)
        return resolved

    def floors(self, floors: FloatArray) -> FloatArray:
        """Return amplitudes of independent noise (n_channels,), resolved along x and y."""
        resolved = floors.copy()
        for rows, matrix in self._pairs:
            resolved[rows] = np.sqrt(matrix**2 @ floors[rows] ** 2)
        return resolved

    def qualities(self, qualities: tuple[Quality, ...]) -> tuple[Quality, ...]:
        """Return the quality of each resolved signal, given that of each transducer, in order.

        It is the worse quality of the two transducers that the signal is computed from, with the
        reason `REDUCED_PROBES` if only the transducer of the other signal is bad.
        """
        resolved = list(qualities)
        for rows, _ in self._pairs:
            for own, other in (rows, rows[::-1]):
                both = worst((qualities[own], qualities[other]))
                is_other = both.level is Level.BAD and qualities[own].level is not Level.BAD
                resolved[own] = bad(Reason.REDUCED_PROBES) if is_other else both
        return tuple(resolved)
