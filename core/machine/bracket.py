"""The structure that holds a guide bearing, as a spring that force is read from."""

import math
from dataclasses import dataclass

import numpy as np

from core.arrays import ComplexArray, FloatArray

MIN_NATURAL_HZ = 15.0
"""Natural frequency of the heaviest bracket that is thought of; those of Brito et al., Table 1,
have 24 to 26 Hz."""


@dataclass(frozen=True)
class BracketDynamics:
    """Isotropic spring, effective mass and damper between bearing and foundation.

    Parameters
    ----------
    mass_kg
        Effective mass m_b of bracket and bearing; None if not known, which leaves its inertia out.
    damping_n_s_per_m
        Structural damping c_b; usually not known and zero.
    """

    stiffness_n_per_m: float
    mass_kg: float | None = None
    damping_n_s_per_m: float = 0.0

    def __post_init__(self) -> None:
        if not self.stiffness_n_per_m > 0.0:
            raise ValueError(f"bracket stiffness must be above 0 N/m, got {self.stiffness_n_per_m}")

    @property
    def max_mass_kg(self) -> float:
        """The mass, or the largest that a bracket of that stiffness may be thought to have."""
        if self.mass_kg is not None:
            return self.mass_kg
        return self.stiffness_n_per_m / (2.0 * math.pi * MIN_NATURAL_HZ) ** 2

    def dynamic_stiffness_n_per_m(self, frequency_hz: FloatArray) -> ComplexArray:
        """Force that the film exerts per absolute displacement of the bracket, (n_lines,).

        ``k_b - m_b ω² + iω c_b``: the bracket's row of Brito et al., equation (6), in which the
        forces on the rotor do not appear.
        """
        omega = 2.0 * np.pi * frequency_hz
        stiffness: ComplexArray = (
            self.stiffness_n_per_m
            - (self.mass_kg or 0.0) * omega**2
            + 1j * omega * self.damping_n_s_per_m
        )
        return stiffness
