"""The structure that holds a guide bearing, as a spring that force is read from."""

from dataclasses import dataclass

import numpy as np

from core.arrays import ComplexArray, FloatArray


@dataclass(frozen=True)
class BracketDynamics:
    """Isotropic spring, effective mass and damper between bearing and foundation.

    Parameters
    ----------
    mass_kg
        Effective mass m_b of bracket and bearing; zero leaves its inertia out.
    damping_n_s_per_m
        Structural damping c_b; usually not known and zero.
    """

    stiffness_n_per_m: float
    mass_kg: float = 0.0
    damping_n_s_per_m: float = 0.0

    def __post_init__(self) -> None:
        if not self.stiffness_n_per_m > 0.0:
            raise ValueError(f"bracket stiffness must be above 0 N/m, got {self.stiffness_n_per_m}")

    def dynamic_stiffness_n_per_m(self, frequency_hz: FloatArray) -> ComplexArray:
        """Force that the film exerts per absolute displacement of the bracket, (n_lines,).

        ``k_b - m_b ω² + iω c_b``: the bracket's row of Brito et al., equation (6), in which the
        forces on the rotor do not appear.
        """
        omega = 2.0 * np.pi * frequency_hz
        stiffness: ComplexArray = (
            self.stiffness_n_per_m - self.mass_kg * omega**2 + 1j * omega * self.damping_n_s_per_m
        )
        return stiffness
