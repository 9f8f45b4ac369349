"""Masses, springs and heights of a hydrogenerator as a rigid rotor: the numbers of the model.

Source: Brito, Machado, Chaves Neto, Martini, "Experimental Estimation of Journal Bearing Stiffness
for Damage Detection in Large Hydrogenerators", Table 2.
"""

from dataclasses import dataclass
from enum import StrEnum

N_SHAFT_COORDINATES = 4
"""X, Y of the mass centre and the tilts φ_x, φ_y."""

UNBALANCE_REFERENCE_FORCE_N = 75.6e3
"""Rotating force of unbalance grade G4.25 at 92.3 r/min, read back from the paper's Table 4."""
UNBALANCE_REFERENCE_GRADE_MM_S = 4.25
UNBALANCE_REFERENCE_SPEED_RPM = 92.3


@dataclass(frozen=True)
class Bracket:
    """The structure that holds a guide bearing: an effective mass on an isotropic spring.

    Parameters
    ----------
    height_m
        Height of the bearing above the mass centre of the rotor.
    """

    bearing: str
    height_m: float
    mass_kg: float
    stiffness_n_per_m: float


UJB = Bracket("UJB", height_m=5.433, mass_kg=0.45e5, stiffness_n_per_m=1.18e9)
LJB = Bracket("LJB", height_m=0.088, mass_kg=1.00e5, stiffness_n_per_m=2.22e9)
TJB = Bracket("TJB", height_m=-8.767, mass_kg=0.80e5, stiffness_n_per_m=2.13e9)


@dataclass(frozen=True)
class RotorParameters:
    """Rigid rotor on three brackets; the defaults are Table 2 of Brito et al.

    Parameters
    ----------
    magnetic_stiffness_n_per_m
        Of the generator's air gap. Table 2 gives -0.60e9 for the excited machine; the paper's
        simulations, and so the default, are those of the machine not excited.
    thrust_stiffness_n_per_m, thrust_radius_m
        Axial stiffness of the thrust bearing and radius of its pad circle. The text does not say
        how it acts; the tables follow if its pads resist tilt.
    """

    rotor_mass_kg: float = 2.37e6
    polar_inertia_kg_m2: float = 0.84e8
    diametral_inertia_kg_m2: float = 1.09e8
    brackets: tuple[Bracket, ...] = (UJB, LJB, TJB)
    generator_height_m: float = 2.328
    runner_height_m: float = -12.617
    magnetic_stiffness_n_per_m: float = 0.0
    seal_stiffness_n_per_m: float = 5.0e7
    thrust_stiffness_n_per_m: float = 19.4e9
    thrust_radius_m: float = 2.113

    @property
    def tilt_stiffness_n_m_per_rad(self) -> float:
        """Resistance of evenly spread thrust pads to tilt about a diameter, k₈ l₅² / 2."""
        return self.thrust_stiffness_n_per_m * self.thrust_radius_m**2 / 2.0

    @property
    def n_coordinates(self) -> int:
        """Degrees of freedom: four of the shaft and two of each bracket."""
        return N_SHAFT_COORDINATES + 2 * len(self.brackets)


class ForcePlane(StrEnum):
    """Where a radial force acts on the rotor."""

    MASS_CENTRE = "mass_centre"
    GENERATOR = "generator"
    RUNNER = "runner"


def unbalance_force_n(grade_mm_s: float, speed_rpm: float) -> float:
    """Rotating force of an unbalance that has the given ISO grade at 92.3 r/min.

    The unbalance is a mass on a radius, so its force grows with the square of speed.
    """
    grade = grade_mm_s / UNBALANCE_REFERENCE_GRADE_MM_S
    return UNBALANCE_REFERENCE_FORCE_N * grade * (speed_rpm / UNBALANCE_REFERENCE_SPEED_RPM) ** 2
