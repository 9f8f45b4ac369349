"""Linear coefficients of an oil film: what the relative motion of the shaft meets in a bearing."""

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
