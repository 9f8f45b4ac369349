"""Tilting pads whose oil films obey Reynolds' equation, for whirl of any frequency.

Isoviscous films, rigid pads without inertia on line pivots. A pad tilts with the whirl, so that
stiffness and damping depend on the whirl frequency, and on each pad's own clearance.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from acquisition.simulated.plant.films import Film, TiltLag
from core.arrays import FloatArray
from core.units import rad_s_from_rpm

N_CELLS = 48
"""Cells along a pad. Twice as many change stiffness by less than 0.2 %."""

ORDERS = np.arange(1, 16, 2)
"""Orders of the axial cosine series of the pressure on a pad."""

ACROSS, SHARES = (half[12:] for half in np.polynomial.legendre.leggauss(24))
"""Places across half a pad, from 0 to 1, and their weights in the mean."""

COSINES = (4.0 / np.pi) * (
    (np.sin(ORDERS * np.pi / 2.0) / ORDERS) * np.cos(np.outer(ACROSS, ORDERS) * np.pi / 2.0)
)

LEAST_TILT, MOST_TILT = 0.02, 0.97
"""Tilts between which a pad is in balance, as fractions of that at which its edge touches."""

COMPLEX_STEP = 1e-30
"""Imaginary step of exact derivatives (Squire and Trapp 1998)."""


@dataclass(frozen=True)
class TiltingPads:
    """Equal, evenly spaced pads of one bearing.

    Parameters
    ----------
    length_m, width_m
        Dimensions of a pad along and across the motion of the journal's surface.
    pivot_offset
        Distance from leading edge to pivot as a fraction of the length; 0.5 is central.
    first_pad_deg
        Angle of the first pad's pivot from x towards y.
    """

    n_pads: int
    journal_radius_m: float
    pad_radius_m: float
    length_m: float
    width_m: float
    pivot_offset: float
    first_pad_deg: float = 0.0

    def film(
        self,
        pad_clearance_um: FloatArray,
        centre_um: tuple[float, float],
        viscosity_pa_s: float,
        speed_rpm: float,
    ) -> Film:
        """Return the film about a mean position of the shaft.

        Parameters
        ----------
        pad_clearance_um : (n_pads,)
            Film thickness at each pivot with a centred shaft.
        centre_um
            Position (x, y) of the shaft centre relative to the bearing centre.

        Raises
        ------
        ValueError
            If the shaft touches a pad, or no tilt balances a pad.
        """
        angles = math.radians(self.first_pad_deg)
        angles += 2.0 * np.pi * np.arange(self.n_pads) / self.n_pads
        towards = np.column_stack([np.cos(angles), np.sin(angles)])
        gaps_um = pad_clearance_um - towards @ np.array(centre_um)
        if not float(gaps_um.min()) > 0.0:
            raise ValueError(
                f"the shaft touches a pad: the thinnest film is {gaps_um.min():.1f} µm"
            )
        strength = viscosity_pa_s * rad_s_from_rpm(speed_rpm)
        coefficients, lags = np.zeros((2, 2, 2)), []
        for angle, direction, gap_um in zip(angles, towards, gaps_um, strict=True):
            k, c, lagging, turns = self._pad(1e-6 * float(gap_um))
            along = np.outer(direction, direction)
            coefficients += np.multiply.outer([k * strength, c * viscosity_pa_s], along)
            lags.append(
                TiltLag(float(angle), lagging * strength, turns / rad_s_from_rpm(speed_rpm))
            )
        return Film(*coefficients.ravel().tolist(), tuple(lags))

    def _pad(self, gap_m: float) -> tuple[float, float, float, float]:
        """Return the stiffness and damping of one pad at slow whirl, its `TiltLag` and lag.

        For unit viscosity and angular velocity. `gap_m` is the film thickness at the pivot.
        """
        from scipy.optimize import brentq  # slow import, not needed at start-up

        behind_rad = (1.0 - self.pivot_offset) * self.length_m / self.journal_radius_m
        crown_m = (self.pad_radius_m - self.journal_radius_m) * (1.0 - math.cos(behind_rad))
        touching = (crown_m + gap_m * math.cos(behind_rad)) / math.sin(behind_rad)

        def lean(share: float) -> float:
            force, moment = self._load(np.array([gap_m, share * touching, 0.0, 0.0]))
            return float(moment / force)

        tilt = touching * brentq(lean, LEAST_TILT, MOST_TILT)
        state = np.array([gap_m, tilt, 0.0, 0.0])
        steps = 1j * COMPLEX_STEP * np.eye(4)
        slopes = np.array([self._load(state + step).imag / COMPLEX_STEP for step in steps])
        # with s = iω the moment of a pad without inertia vanishes: eliminate its tilt
        (k_gap, m_gap), (k_tilt, m_tilt), (c_gap, n_gap), (c_tilt, n_tilt) = slopes.tolist()
        lag, quick = n_tilt / m_tilt, c_tilt * n_gap / n_tilt
        lagging = (k_tilt - c_tilt / lag) * (m_gap - n_gap / lag) / m_tilt
        k = k_tilt * m_gap / m_tilt - k_gap
        return k, quick - lagging * lag - c_gap, lagging, lag

    def _load(self, state: npt.NDArray[np.inexact]) -> npt.NDArray[np.inexact]:
        """Return the force of a film on a pad and its moment about the pivot over the radius, (2,).

        `state` holds the film thickness at the pivot, the tilt times the radius, and their rates of
        change. Negative pressure is left out, because oil cavitates (Gümbel).
        """
        edge_m = self.length_m * (np.linspace(0.0, 1.0, N_CELLS + 1) - self.pivot_offset)
        middle_m, cell_m = (edge_m[1:] + edge_m[:-1]) / 2.0, self.length_m / N_CELLS
        cos, sin = (np.array(f(middle_m / self.journal_radius_m)) for f in (np.cos, np.sin))
        apart_m = self.pad_radius_m - self.journal_radius_m

        def thickness(cos: FloatArray, sin: FloatArray) -> npt.NDArray[np.inexact]:
            return np.asarray(apart_m - (apart_m - state[0]) * cos - state[1] * sin)

        angle = edge_m / self.journal_radius_m
        edges, inside = thickness(np.cos(angle), np.sin(angle)), thickness(cos, sin)
        flow = edges**3 / cell_m
        flow[[0, -1]] *= 2.0
        cells, across = np.arange(N_CELLS), (ORDERS[:, np.newaxis] * np.pi / self.width_m) ** 2
        matrix = np.zeros((ORDERS.size, N_CELLS, N_CELLS), dtype=flow.dtype)
        matrix[:, cells, cells] = -(flow[1:] + flow[:-1]) - across * inside**3 * cell_m
        matrix[:, cells[:-1], cells[1:]] = matrix[:, cells[1:], cells[:-1]] = flow[1:-1]
        squeeze = 12.0 * cell_m * (state[2] * cos - state[3] * sin)
        source = 6.0 * self.journal_radius_m * np.diff(edges) + squeeze
        parts = np.linalg.solve(matrix, np.broadcast_to(source, matrix.shape[:2])[..., np.newaxis])
        pressure = COSINES @ parts[..., 0]
        line = SHARES @ np.where(pressure.real > 0.0, pressure, 0.0) * self.width_m * cell_m
        return np.array([line @ cos, line @ sin])


PADS: Mapping[str, TiltingPads] = MappingProxyType(
    {
        "UJB": TiltingPads(16, 1.1, 1.103, 0.35, 0.40, 0.6),
        "LJB": TiltingPads(16, 2.6, 2.604, 0.62, 0.31, 0.6),
        "TJB": TiltingPads(12, 1.6, 1.633, 0.50, 0.50, 0.5),
    }
)
"""Pads of the guide bearings of Brito et al., Table 1."""

WARM_UM: Mapping[str, float] = MappingProxyType({"UJB": 500.0, "LJB": 615.0, "TJB": 425.0})
"""Clearances of the warm bearings."""
