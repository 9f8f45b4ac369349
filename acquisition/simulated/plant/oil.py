"""Viscosity of a lubricating oil over temperature."""

import math
from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray

WALTHER_OFFSET_MM2_S = 0.7
"""Constant of ASTM D341 for viscosities above 2 mm²/s."""

KELVIN_AT_0_C = 273.15


@dataclass(frozen=True)
class Oil:
    """An oil known by its viscosity at two temperatures.

    The defaults are Lubrax Turbina Plus 50 as in Brito et al., Table 1.

    Parameters
    ----------
    viscosity_40_pa_s, viscosity_100_pa_s
        Dynamic viscosity at 40 °C and 100 °C.
    expansion_per_k
        Relative loss of density per kelvin; 6.5e-4 is usual for mineral oils.

    Raises
    ------
    ValueError
        If the oil is not thinner at 100 °C than at 40 °C, or a viscosity is not above zero.
    """

    viscosity_40_pa_s: float = 0.047
    viscosity_100_pa_s: float = 0.0068
    density_20_kg_per_m3: float = 873.0
    expansion_per_k: float = 6.5e-4

    def __post_init__(self) -> None:
        if not 0.0 < self.viscosity_100_pa_s < self.viscosity_40_pa_s:
            raise ValueError(
                f"viscosity at 100 °C ({self.viscosity_100_pa_s:g} Pa·s) must be above 0 and below"
                f" that at 40 °C ({self.viscosity_40_pa_s:g} Pa·s)"
            )

    def density_kg_per_m3(self, temperature_c: FloatArray) -> FloatArray:
        """Density, linear in temperature."""
        return self.density_20_kg_per_m3 * (1.0 - self.expansion_per_k * (temperature_c - 20.0))

    def viscosity_pa_s(self, temperature_c: FloatArray) -> FloatArray:
        """Dynamic viscosity by Walther's law, ASTM D341: lg lg (ν + 0.7) = A − B lg T.

        ν is the kinematic viscosity in mm²/s and T the absolute temperature.
        """
        lg_kelvin = np.log10(np.asarray(temperature_c) + KELVIN_AT_0_C)
        height = self._walther(40.0) - self._slope * (lg_kelvin - _lg_kelvin(40.0))
        kinematic_mm2_s = 10.0 ** (10.0**height) - WALTHER_OFFSET_MM2_S
        return np.asarray(1e-6 * kinematic_mm2_s * self.density_kg_per_m3(temperature_c))

    @property
    def _slope(self) -> float:
        fall = self._walther(40.0) - self._walther(100.0)
        return fall / (_lg_kelvin(100.0) - _lg_kelvin(40.0))

    def _walther(self, temperature_c: float) -> float:
        """Left side of Walther's law at one of the two known temperatures."""
        known = self.viscosity_40_pa_s if temperature_c == 40.0 else self.viscosity_100_pa_s
        kinematic_mm2_s = 1e6 * known / float(self.density_kg_per_m3(np.asarray(temperature_c)))
        return math.log10(math.log10(kinematic_mm2_s + WALTHER_OFFSET_MM2_S))


def _lg_kelvin(temperature_c: float) -> float:
    return math.log10(temperature_c + KELVIN_AT_0_C)
