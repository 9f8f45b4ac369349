"""Oil films: stiffness and damping coefficients, tilting pads, viscosity of oil."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple, Self

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.units import rad_s_from_rpm

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
        """Return the magnitudes ``|k_xx + iωc_xx|`` and ``|k_yy + iωc_yy|`` in N/m.

        Equation (5) of Brito et al. estimates them if cross-coupling is negligible.
        """
        x, y = abs(np.diag(self.dynamic_stiffness_n_per_m(frequency_rad_s))).tolist()
        return x, y


@dataclass(frozen=True, eq=False)
class FilmColumns:
    """Time series of a film whose matrices are symmetric.

    Parameters
    ----------
    k_xx_n_per_m, k_xy_n_per_m, k_yy_n_per_m : (n,)
        Stiffness at the running speed.
    c_n_s_per_m, lag_n_per_m : (3, n)
        Damping at the running speed, and sum of the pads' `TiltLag`; xx, xy and yy.
    lag_s, lag_turn_rad : (n,)
        Mean lag of the pads, and the angle by which the shaft turns meanwhile.
    """

    k_xx_n_per_m: FloatArray
    k_xy_n_per_m: FloatArray
    k_yy_n_per_m: FloatArray
    c_n_s_per_m: FloatArray
    lag_n_per_m: FloatArray
    lag_s: FloatArray
    lag_turn_rad: FloatArray

    def at(self, row: int) -> Film:
        """Return the film at one row, with the sum of the pads' lags along 0, 45 and 90°."""
        k = np.array([self.k_xx_n_per_m[row], self.k_xy_n_per_m[row], self.k_yy_n_per_m[row]])
        constant = _film(k, self.c_n_s_per_m[:, row])
        (r_xx, r_xy, r_yy), lag_s = self.lag_n_per_m[:, row].tolist(), float(self.lag_s[row])
        if lag_s == 0.0:
            return constant
        sizes = zip((0.0, 45.0, 90.0), (r_xx - r_xy, 2.0 * r_xy, r_yy - r_xy), strict=True)
        lags = tuple(TiltLag(math.radians(angle), size, lag_s) for angle, size in sizes)
        turn = 1j * float(self.lag_turn_rad[row])
        slow = turn**2 / (1.0 + turn) * self.lag_n_per_m[:, row]
        slow_c = self.c_n_s_per_m[:, row] - slow.imag * lag_s / turn.imag
        return _film(k - slow.real, slow_c, lags)


def _film(k_n_per_m: FloatArray, c_n_s_per_m: FloatArray, lags: tuple[TiltLag, ...] = ()) -> Film:
    """Return a film with symmetric matrices, given by xx, xy and yy."""
    (k_xx, k_xy, k_yy), (c_xx, c_xy, c_yy) = k_n_per_m.tolist(), c_n_s_per_m.tolist()
    return Film(k_xx, k_xy, k_xy, k_yy, c_xx, c_xy, c_xy, c_yy, lags)


class PadLaw(NamedTuple):
    """Film of one pivoted pad: coefficients of polynomials in ln(h / 400 µm), in ascending powers.

    h is the film thickness at the pivot; viscosity and angular velocity ω are 1.

    Parameters
    ----------
    stiffness, damping
        Polynomials of ln(k (h / 400 µm)³) and ln(ω c (h / 400 µm)³).
    lagging, turn_rad
        Polynomials of the size of `TiltLag` over k, and of the turn of the shaft during the lag.
    """

    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    lagging: tuple[float, ...]
    turn_rad: tuple[float, ...]


PAD_LAWS: Mapping[str, PadLaw] = MappingProxyType(
    {
        "UJB": PadLaw(
            (19.6656, -0.0192, -0.0236, 0.0174, -0.0021),
            (18.5159, 0.2347, -0.0748, 0.0125, -0.003),
            (-0.1179, -0.3168, 0.0498, 0.0225, -0.0089),
            (0.1249, 0.0245, -0.0011, -0.0021, 0.0003),
        ),
        "LJB": PadLaw(
            (20.3388, -0.1345, 0.0094, 0.0118, -0.0025),
            (19.0199, 0.2038, -0.0436, 0.0046, -0.0028),
            (-0.0666, -0.2973, 0.0281, 0.0199, -0.0051),
            (0.1335, 0.0376, 0.0007, -0.0026, -0.0001),
        ),
        "TJB": PadLaw(
            (20.4532, 0.2964, -0.2165, -0.0286, 0.0017),
            (18.1539, 0.6404, -0.102, 0.0748, 0.0305),
            (0.4374, 0.3769, 0.1041, -0.0386, -0.021),
            (0.1322, 0.0165, -0.0121, 0.0005, 0.0003),
        ),
    }
)
"""Pads of Brito et al., Table 1, by Reynolds' equation (`benchmarks/pads.py`): fitted for 60 to
1100 µm within 0.2 % (UJB and LJB), and for 85 to 900 µm within 5 % (TJB, whose film cavitates)."""


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
    law
        Film of each pad, whose forces are scaled to the given stiffness. By default stiffness goes
        with h⁻³, damping is proportional to it, and both are constant over whirl frequency.
    """

    n_pads: int
    stiffness_n_per_m: float
    clearance_um: float
    viscosity_pa_s: float
    speed_rpm: float
    first_pad_deg: float = 0.0
    law: PadLaw | None = None

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
        """Return the film about a mean position of the shaft.

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
        # the mean of cos² around the shaft is a half
        oil = viscosity_pa_s / self.viscosity_pa_s * (speed_rpm / self.speed_rpm)
        strength = self.stiffness_n_per_m * 2.0 / self.n_pads * oil
        design = self._pad(np.array([self.clearance_um]))[0]
        sums, turned_rad = np.zeros((3, 3, centre_um.shape[1])), np.zeros(centre_um.shape[1])
        for clearance_um, angle in zip(pad_clearance_um, self.pad_angles_rad, strict=True):
            cos, sin = math.cos(angle), math.sin(angle)
            thickness_um = clearance_um - (cos * centre_um[0] + sin * centre_um[1])
            if not float(np.min(thickness_um)) > 0.0:
                thinnest = f"{float(np.min(thickness_um)):.1f} µm"
                raise ValueError(f"the shaft touches a pad: the thinnest film is {thinnest}")
            *forces, turn_rad = self._pad(thickness_um)
            along = np.array([[cos * cos], [cos * sin], [sin * sin]])
            sums += np.array(forces)[:, np.newaxis] * along
            turned_rad += forces[0] * turn_rad
        turn_rad = turned_rad / (sums[0, 0] + sums[0, 2])
        k, c, lagging = sums * strength / design
        if self.law is None:
            return FilmColumns(k[0], k[1], k[2], DAMPING_OVER_STIFFNESS_S * k, c, c[0], c[0])
        running = np.where(speed_rpm > 0.0, rad_s_from_rpm(1.0) * speed_rpm, np.inf)
        lag = lagging, turn_rad / running, turn_rad
        return FilmColumns(k[0], k[1], k[2], c / running, *lag)

    def _pad(self, thickness_um: FloatArray) -> FloatArray:
        """Return relative stiffness, damping and lagging part of a pad, and its lag's turn, (4, n).

        All for films of these thicknesses (n,) at equal viscosity and speed.
        """
        cubed = (400.0 / thickness_um) ** 3
        if self.law is None:
            return np.array([cubed, *np.zeros((3, cubed.size))])
        logarithm = np.log(thickness_um / 400.0)
        k, c, lagging, turn_rad = (np.polyval(each[::-1], logarithm) for each in self.law)
        k = cubed * np.exp(k)
        return np.array([k, cubed * np.exp(c), k * lagging, turn_rad])


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
        known_c = np.array([40.0, 100.0])
        known = np.array([self.viscosity_40_pa_s, self.viscosity_100_pa_s])
        known_mm2_s = 1e6 * known / self.density_kg_per_m3(known_c)
        first, last = np.log10(np.log10(known_mm2_s + WALTHER_OFFSET_MM2_S)).tolist()
        lg_40, lg_100 = np.log10(known_c + KELVIN_AT_0_C).tolist()
        lg_kelvin = np.log10(np.asarray(temperature_c) + KELVIN_AT_0_C)
        height = first - (first - last) / (lg_100 - lg_40) * (lg_kelvin - lg_40)
        kinematic_mm2_s = 10.0 ** (10.0**height) - WALTHER_OFFSET_MM2_S
        return np.asarray(1e-6 * kinematic_mm2_s * self.density_kg_per_m3(temperature_c))
