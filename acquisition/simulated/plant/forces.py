"""All forces on the rotor of a unit, by the planes that they act on."""

import numpy as np

from acquisition.simulated.plant.excitation import (
    Excitation,
    HydraulicForce,
    RopeForce,
    UnbalanceForce,
)
from acquisition.simulated.plant.rotation import Turning
from acquisition.simulated.plant.rotor import ForcePlane, unbalance_force_n
from acquisition.simulated.plant.scenario import Scenario
from core.arrays import FloatArray
from core.units import hz_from_rpm


def force_planes(scenario: Scenario) -> list[ForcePlane]:
    """Planes on which forces act, in order; every one costs time."""
    used = {ForcePlane.MASS_CENTRE, ForcePlane.RUNNER, scenario.hydraulic.plane}
    return [plane for plane in ForcePlane if plane in used]


class Forces:
    """Unbalance, broadband hydraulic force and vortex rope.

    Parameters
    ----------
    first
        Scenario of the first chunk. Planes, the band of the hydraulic force, order and width of the
        rope stay as they are there; how large the forces are may change.
    rated_speed_rpm
        The speed that `rotation` counts from.
    """

    def __init__(
        self,
        first: Scenario,
        rated_speed_rpm: float,
        rate_hz: float,
        rotation: Turning,
        hydraulic: np.random.Generator,
        rope: np.random.Generator,
    ) -> None:
        self._rated_speed_rpm = rated_speed_rpm
        noise, vortex = first.hydraulic, first.rope
        rope_hz = vortex.order * hz_from_rpm(rated_speed_rpm)
        of_one_newton: tuple[tuple[ForcePlane, Excitation], ...] = (
            (ForcePlane.MASS_CENTRE, UnbalanceForce(1.0, rotation)),
            (noise.plane, HydraulicForce(hydraulic, 1.0, noise.cutoff_hz, rate_hz)),
            (ForcePlane.RUNNER, RopeForce(rope, 1.0, rope_hz, vortex.line_width_hz, rate_hz)),
        )
        planes = force_planes(first)
        self._excitations = [(planes.index(p), excitation) for p, excitation in of_one_newton]
        self._n_planes = len(planes)

    def advance(self, n_samples: int, start: Scenario, stop: Scenario) -> FloatArray:
        """Give the next forces, while one scenario goes over into another.

        Returns
        -------
        (2 · n_planes, n_samples) in newtons.
        """
        total = np.zeros((self._n_planes, 2, n_samples))
        sizes = zip(self._sizes_n(start), self._sizes_n(stop), strict=True)
        for (plane, excitation), (from_n, to_n) in zip(self._excitations, sizes, strict=True):
            force = excitation.advance(n_samples)
            total[plane] += straight(from_n, to_n, n_samples) * force
        return total.reshape(2 * self._n_planes, n_samples)

    def _sizes_n(self, scenario: Scenario) -> tuple[float, float, float]:
        """Unbalance at rated speed, rms of the hydraulic force, rope."""
        grade_mm_s = scenario.unbalance_grade_mm_s
        return (
            unbalance_force_n(grade_mm_s, self._rated_speed_rpm),
            scenario.hydraulic.rms_n,
            scenario.rope.force_n,
        )


def straight(start: float, stop: float, n_samples: int) -> FloatArray | float:
    """Straight line over a chunk, not reaching its end; one number if it is level."""
    if start == stop:
        return start
    return np.linspace(start, stop, n_samples, endpoint=False)
