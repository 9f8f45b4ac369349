"""Oil films: coefficients of a bearing, tilting pads, viscosity of oil."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from core.arrays import FloatArray

DAMPING_OVER_STIFFNESS_S = 0.0125
"""c = α k with α = 0.0125 s (Brito et al., section 2.2.1, after Cardinali)."""


@dataclass(frozen=True)
class Film:
    """Stiffness and damping of one oil film, linear about the shaft's mean position.

    The force on the bracket is ``k u + c du/dt`` with u the shaft relative to the bracket
    (Brito et al., equation 1).
    """

    k_xx_n_per_m: float
    k_xy_n_per_m: float
    k_yx_n_per_m: float
    k_yy_n_per_m: float
    c_xx_n_s_per_m: float
    c_xy_n_s_per_m: float
    c_yx_n_s_per_m: float
    c_yy_n_s_per_m: float

    @classmethod
    def proportional(
        cls,
        k_xx_n_per_m: float,
        k_yy_n_per_m: float,
        k_cross_n_per_m: float = 0.0,
        damping_over_stiffness_s: float = DAMPING_OVER_STIFFNESS_S,
    ) -> Self:
        """Film with damping proportional to its direct stiffness.

        The paper's text makes cross-coupled damping proportional too, but only without it do its
        conditions 4 and 5 come out; `k_cross_n_per_m` is both k_xy and k_yx.
        """
        return cls(
            k_xx_n_per_m=k_xx_n_per_m,
            k_xy_n_per_m=k_cross_n_per_m,
            k_yx_n_per_m=k_cross_n_per_m,
            k_yy_n_per_m=k_yy_n_per_m,
            c_xx_n_s_per_m=damping_over_stiffness_s * k_xx_n_per_m,
            c_xy_n_s_per_m=0.0,
            c_yx_n_s_per_m=0.0,
            c_yy_n_s_per_m=damping_over_stiffness_s * k_yy_n_per_m,
        )

    @property
    def stiffness_n_per_m(self) -> FloatArray:
        """(2, 2) stiffness: rows are force directions, columns motion directions."""
        return np.array(
            [[self.k_xx_n_per_m, self.k_xy_n_per_m], [self.k_yx_n_per_m, self.k_yy_n_per_m]]
        )

    @property
    def damping_n_s_per_m(self) -> FloatArray:
        """(2, 2) damping: rows are force directions, columns motion directions."""
        return np.array(
            [[self.c_xx_n_s_per_m, self.c_xy_n_s_per_m], [self.c_yx_n_s_per_m, self.c_yy_n_s_per_m]]
        )

    def effective_stiffness_n_per_m(self, frequency_rad_s: float) -> tuple[float, float]:
        """Magnitudes ``|k_xx + iωc_xx|`` and ``|k_yy + iωc_yy|``.

        They are what equation (5) of Brito et al. estimates when cross-coupling is negligible.
        """
        return (
            math.hypot(self.k_xx_n_per_m, frequency_rad_s * self.c_xx_n_s_per_m),
            math.hypot(self.k_yy_n_per_m, frequency_rad_s * self.c_yy_n_s_per_m),
        )


@dataclass(frozen=True, eq=False)
class FilmColumns:
    """Stiffness of a film over time, N/m; all (n,). k_yx equals k_xy."""

    k_xx_n_per_m: FloatArray
    k_xy_n_per_m: FloatArray
    k_yy_n_per_m: FloatArray

    def at(self, row: int) -> Film:
        """Film at one moment.

        Damping is proportional to the full stiffness matrix: oil squeezed out from under a pad that
        follows the shaft resists by μ/h³, as it does in sliding.
        """
        k_xx, k_xy, k_yy = (
            float(k[row]) for k in (self.k_xx_n_per_m, self.k_xy_n_per_m, self.k_yy_n_per_m)
        )
        c_xx, c_xy, c_yy = (DAMPING_OVER_STIFFNESS_S * k for k in (k_xx, k_xy, k_yy))
        return Film(k_xx, k_xy, k_xy, k_yy, c_xx, c_xy, c_xy, c_yy)


@dataclass(frozen=True)
class PadRing:
    """Equal pads evenly spaced around the shaft, described by their stiffness when centred.

    Parameters
    ----------
    first_pad_deg
        Angle of the first pad's pivot from x towards y.
    stiffness_n_per_m
        Direct stiffness, equal in all directions, with the shaft centred and the clearance,
        viscosity and speed below.
    clearance_um
        Film thickness at the pivots with the shaft centred: the assembled radial clearance.
    """

    n_pads: int
    stiffness_n_per_m: float
    clearance_um: float
    viscosity_pa_s: float
    speed_rpm: float
    first_pad_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.n_pads < 3:
            raise ValueError(f"a ring needs at least 3 pads, got {self.n_pads}")

    @property
    def pad_angles_rad(self) -> FloatArray:
        """(n_pads,) directions of the pivots."""
        turns = np.arange(self.n_pads) / self.n_pads
        return math.radians(self.first_pad_deg) + 2.0 * math.pi * turns

    def film(
        self,
        pad_clearance_um: FloatArray,
        centre_um: FloatArray,
        viscosity_pa_s: FloatArray,
        speed_rpm: FloatArray,
    ) -> FilmColumns:
        """Stiffness about a mean position of the shaft.

        Parameters
        ----------
        pad_clearance_um : (n_pads, n) or (n_pads, 1)
        centre_um : (2, n)
            Shaft centre from bearing centre.
        viscosity_pa_s, speed_rpm : (n,)

        Raises
        ------
        ValueError
            If the shaft touches a pad.
        """
        strength = 2.0 * self._strength(viscosity_pa_s, speed_rpm)  # dF/dh = 2 F/h
        k_xx, k_xy, k_yy = (np.zeros(centre_um.shape[1]) for _ in range(3))
        for clearance_um, angle in zip(pad_clearance_um, self.pad_angles_rad, strict=True):
            cos, sin = math.cos(angle), math.sin(angle)
            inverse = 1.0 / _thickness_um(clearance_um, centre_um, cos, sin)
            cubed = inverse * inverse * inverse
            k_xx += cos * cos * cubed
            k_xy += cos * sin * cubed
            k_yy += sin * sin * cubed
        strength *= 1e6  # per µm to per m
        return FilmColumns(strength * k_xx, strength * k_xy, strength * k_yy)

    def force_n(
        self,
        pad_clearance_um: FloatArray,
        centre_um: FloatArray,
        viscosity_pa_s: FloatArray,
        speed_rpm: FloatArray,
    ) -> FloatArray:
        """Mean force (x, y) of the pads on the bearing, (2, n); parameters as in `film`.

        It is the static load that holds the shaft in this position.
        """
        total = np.zeros((2, centre_um.shape[1]))
        for clearance_um, angle in zip(pad_clearance_um, self.pad_angles_rad, strict=True):
            cos, sin = math.cos(angle), math.sin(angle)
            squared = _thickness_um(clearance_um, centre_um, cos, sin) ** -2.0
            total += np.outer((cos, sin), squared)
        return self._strength(viscosity_pa_s, speed_rpm) * total

    def _strength(self, viscosity_pa_s: FloatArray, speed_rpm: FloatArray) -> FloatArray:
        """Force of one pad times its thickness squared, N µm²."""
        pad_n_per_um = 1e-6 * self.stiffness_n_per_m * 2.0 / self.n_pads  # mean of cos² is a half
        oil = viscosity_pa_s / self.viscosity_pa_s * (speed_rpm / self.speed_rpm)
        return np.asarray(0.5 * pad_n_per_um * self.clearance_um**3 * oil)


def _thickness_um(
    clearance_um: FloatArray, centre_um: FloatArray, cos: float, sin: float
) -> FloatArray:
    thickness_um = clearance_um - (cos * centre_um[0] + sin * centre_um[1])
    thinnest_um = float(np.min(thickness_um))
    if not thinnest_um > 0.0:
        raise ValueError(f"the shaft touches a pad: film of {thinnest_um:.1f} µm")
    return np.asarray(thickness_um)


WALTHER_OFFSET_MM2_S = 0.7
"""Constant of ASTM D341 for viscosities above 2 mm²/s."""

KELVIN_AT_0_C = 273.15


@dataclass(frozen=True)
class Oil:
    """Oil described by its viscosity at two temperatures.

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
        If the viscosity at 100 °C is not above zero and below that at 40 °C.
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
