"""Film of a tilting-pad guide bearing: a ring of pivoted pads around a vertical shaft.

A pivoted pad tilts until its film pressure acts through the pivot, so that the ratio of inlet to
outlet thickness, and with it the shape of the pressure, does not depend on the thickness h at the
pivot. Reynolds' equation then leaves F ∝ μ U / h² for the pad's force (Michell 1905; Hamrock,
Schmid, Jacobson, *Fundamentals of Fluid Film Lubrication*, fixed and pivoted-pad slider bearings),
and 2 F / h for its stiffness. Pads carry no moment: there is no cross-coupling but that of pads
which differ in thickness. Pivots count as rigid (Brito et al., section 3.1).
"""

import math
from dataclasses import dataclass

import numpy as np

from acquisition.simulated.plant.films import DAMPING_OVER_STIFFNESS_S, Film
from core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class FilmColumns:
    """Stiffness of a film over time, N/m; all (n,). k_yx equals k_xy."""

    k_xx_n_per_m: FloatArray
    k_xy_n_per_m: FloatArray
    k_yy_n_per_m: FloatArray

    def at(self, row: int) -> Film:
        """Film at one moment.

        Damping is proportional to all of the stiffness: squeezed out from under a pad that follows
        the shaft, oil resists by μ/h³ as it does by sliding.
        """
        k_xx, k_xy, k_yy = (
            float(k[row]) for k in (self.k_xx_n_per_m, self.k_xy_n_per_m, self.k_yy_n_per_m)
        )
        c_xx, c_xy, c_yy = (DAMPING_OVER_STIFFNESS_S * k for k in (k_xx, k_xy, k_yy))
        return Film(k_xx, k_xy, k_xy, k_yy, c_xx, c_xy, c_xy, c_yy)


@dataclass(frozen=True)
class PadRing:
    """Equal pads evenly around the shaft, known by the stiffness they have centred.

    Parameters
    ----------
    first_pad_deg
        Angle of the first pad's pivot from x towards y.
    stiffness_n_per_m
        Direct stiffness, the same in every direction, with the shaft centred and the next three as
        given.
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
        """Mean force (x, y) of the pads on the bearing, (2, n); the parameters are those of `film`.

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
