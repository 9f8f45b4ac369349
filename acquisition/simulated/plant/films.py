"""Oil films: stiffness and damping coefficients, tilting pads, viscosity of oil."""

import math
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from core.arrays import ComplexArray, FloatArray

DAMPING_OVER_STIFFNESS_S = 0.0125
"""Factor α in s of proportional damping c = α k (Brito et al., section 2.2.1, after Cardinali)."""


class TiltLag(NamedTuple):
    """Part of a film's force that depends on whirl frequency, because a pad tilts with a lag.

    With lag τ, it is ``n_per_m (iωτ)² / (1 + iωτ)`` along the direction of the pad's pivot.
    """

    angle_rad: float
    n_per_m: float
    lag_s: float

    @property
    def along(self) -> FloatArray:
        """Unit vector towards the pivot, (2,)."""
        return np.array([math.cos(self.angle_rad), math.sin(self.angle_rad)])


@dataclass(frozen=True)
class Film:
    """Stiffness and damping of one oil film, linear about the mean position of the shaft.

    The force on the bracket is ``k u + c du/dt`` with u the displacement of the shaft relative to
    the bracket (Brito et al., equation 1). With `lags` these are the coefficients at slow whirl.
    """

    k_xx_n_per_m: float
    k_xy_n_per_m: float
    k_yx_n_per_m: float
    k_yy_n_per_m: float
    c_xx_n_s_per_m: float
    c_xy_n_s_per_m: float
    c_yx_n_s_per_m: float
    c_yy_n_s_per_m: float
    lags: tuple[TiltLag, ...] = ()

    @classmethod
    def proportional(
        cls,
        k_xx_n_per_m: float,
        k_yy_n_per_m: float,
        k_cross_n_per_m: float = 0.0,
        damping_over_stiffness_s: float = DAMPING_OVER_STIFFNESS_S,
    ) -> Self:
        """Return a film with direct damping proportional to its direct stiffness.

        According to Brito et al., cross-coupled damping is proportional too, but their conditions 4
        and 5 are reproduced only without it. `k_cross_n_per_m` is both k_xy and k_yx.
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
        """Stiffness matrix, (2, 2): rows are force directions, columns motion directions."""
        return np.array(
            [[self.k_xx_n_per_m, self.k_xy_n_per_m], [self.k_yx_n_per_m, self.k_yy_n_per_m]]
        )

    @property
    def damping_n_s_per_m(self) -> FloatArray:
        """Damping matrix, (2, 2): rows are force directions, columns motion directions."""
        return np.array(
            [[self.c_xx_n_s_per_m, self.c_xy_n_s_per_m], [self.c_yx_n_s_per_m, self.c_yy_n_s_per_m]]
        )

    def dynamic_stiffness_n_per_m(self, frequency_rad_s: float) -> ComplexArray:
        """Return the force per displacement ``K + iωC`` at a whirl frequency, (2, 2)."""
        total = self.stiffness_n_per_m + 1j * frequency_rad_s * self.damping_n_s_per_m
        for lag in self.lags:
            turn = 1j * frequency_rad_s * lag.lag_s
            total += lag.n_per_m * turn**2 / (1.0 + turn) * np.outer(lag.along, lag.along)
        return total

    def at(self, frequency_rad_s: float) -> "Film":
        """Return the film of constant coefficients with the same force at a whirl frequency."""
        whole = self.dynamic_stiffness_n_per_m(frequency_rad_s)
        return Film(*np.concatenate([whole.real, whole.imag / frequency_rad_s], None).tolist())

    def effective_stiffness_n_per_m(self, frequency_rad_s: float) -> tuple[float, float]:
        """Return the magnitudes ``|k_xx + iωc_xx|`` and ``|k_yy + iωc_yy|``.

        In N/m. Equation (5) of Brito et al. estimates them if cross-coupling is negligible.
        """
        x, y = abs(np.diag(self.dynamic_stiffness_n_per_m(frequency_rad_s))).tolist()
        return x, y


@dataclass(frozen=True, eq=False)
class FilmColumns:
    """Time series of the stiffness coefficients of a film in N/m; all (n,). k_yx equals k_xy."""

    k_xx_n_per_m: FloatArray
    k_xy_n_per_m: FloatArray
    k_yy_n_per_m: FloatArray

    def at(self, row: int) -> Film:
        """Return stiffness and damping of the film at one row.

        Damping is proportional to the full stiffness matrix, because the squeeze film of a tilting
        pad has the same factor μ/h³ as the sliding film.
        """
        k_xx, k_xy, k_yy = (
            float(k[row]) for k in (self.k_xx_n_per_m, self.k_xy_n_per_m, self.k_yy_n_per_m)
        )
        c_xx, c_xy, c_yy = (DAMPING_OVER_STIFFNESS_S * k for k in (k_xx, k_xy, k_yy))
        return Film(k_xx, k_xy, k_xy, k_yy, c_xx, c_xy, c_xy, c_yy)


@dataclass(frozen=True)
class PadRing:
    """Tilting-pad bearing with equal, evenly spaced pads.

    Parameters
    ----------
    first_pad_deg
        Angle of the first pad's pivot from x towards y.
    stiffness_n_per_m
        Direct stiffness, equal in all directions, with a centred shaft at the parameters
        `clearance_um`, `viscosity_pa_s` and `speed_rpm`.
    clearance_um
        Film thickness at the pivots with a centred shaft: the assembled radial clearance.
    """

    n_pads: int
    stiffness_n_per_m: float
    clearance_um: float
    viscosity_pa_s: float
    speed_rpm: float
    first_pad_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.n_pads < 3:
            raise ValueError(f"n_pads must be at least 3, got {self.n_pads}")

    @property
    def pad_angles_rad(self) -> FloatArray:
        """Angles of the pivots from x towards y, (n_pads,)."""
        turns = np.arange(self.n_pads) / self.n_pads
        return math.radians(self.first_pad_deg) + 2.0 * math.pi * turns

    def film(
        self,
        pad_clearance_um: FloatArray,
        centre_um: FloatArray,
        viscosity_pa_s: FloatArray,
        speed_rpm: FloatArray,
    ) -> FilmColumns:
        """Return the stiffness of the film about a mean position of the shaft.

        Parameters
        ----------
        pad_clearance_um : (n_pads, n) or (n_pads, 1)
            Film thickness at each pivot with a centred shaft.
        centre_um : (2, n)
            Position of the shaft centre relative to the bearing centre.
        viscosity_pa_s : (n,)
            Dynamic viscosity of the oil.
        speed_rpm : (n,)
            Running speed.

        Raises
        ------
        ValueError
            If the shaft touches a pad.
        """
        # force times the square of the film thickness is constant, dF/dh = 2 F/h; the mean of cos²
        # around the shaft is a half
        oil = viscosity_pa_s / self.viscosity_pa_s * (speed_rpm / self.speed_rpm)
        pad_n_per_um = 1e-6 * self.stiffness_n_per_m * 2.0 / self.n_pads
        strength = pad_n_per_um * self.clearance_um**3 * oil
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


def _thickness_um(
    clearance_um: FloatArray, centre_um: FloatArray, cos: float, sin: float
) -> FloatArray:
    thickness_um = clearance_um - (cos * centre_um[0] + sin * centre_um[1])
    thinnest_um = float(np.min(thickness_um))
    if not thinnest_um > 0.0:
        raise ValueError(f"the shaft touches a pad: the thinnest film is {thinnest_um:.1f} µm")
    return np.asarray(thickness_um)


WALTHER_OFFSET_MM2_S = 0.7
"""Offset of the kinematic viscosity in ASTM D341, valid above 2 mm²/s."""

KELVIN_AT_0_C = 273.15


@dataclass(frozen=True)
class Oil:
    """Oil with temperature-dependent viscosity and density.

    The defaults are Lubrax Turbina Plus 50 as in Brito et al., Table 1.

    Parameters
    ----------
    viscosity_40_pa_s
        Dynamic viscosity at 40 °C.
    viscosity_100_pa_s
        Dynamic viscosity at 100 °C.
    expansion_per_k
        Relative decrease of density per kelvin; 6.5e-4 is usual for mineral oils.

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
        """Return the density, linear in temperature; the result has the shape of the argument."""
        return self.density_20_kg_per_m3 * (1.0 - self.expansion_per_k * (temperature_c - 20.0))

    def viscosity_pa_s(self, temperature_c: FloatArray) -> FloatArray:
        """Return the dynamic viscosity by Walther's law, ASTM D341: lg lg (ν + 0.7) = A − B lg T.

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
        """Return lg lg (ν + 0.7) at 40 °C or 100 °C, the temperatures with given viscosity."""
        known = self.viscosity_40_pa_s if temperature_c == 40.0 else self.viscosity_100_pa_s
        kinematic_mm2_s = 1e6 * known / float(self.density_kg_per_m3(np.asarray(temperature_c)))
        return math.log10(math.log10(kinematic_mm2_s + WALTHER_OFFSET_MM2_S))


def _lg_kelvin(temperature_c: float) -> float:
    return math.log10(temperature_c + KELVIN_AT_0_C)
