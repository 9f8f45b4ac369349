"""Films of a bearing over the years: its pads, its warmth, where the shaft runs, its damage."""

import math
from dataclasses import dataclass

import numpy as np

from acquisition.simulated.life.damage import Alteration
from acquisition.simulated.life.life_bearing import LifeBearing
from acquisition.simulated.life.thermal import ThermalCourse
from acquisition.simulated.plant.tilting_pad import FilmColumns
from core.arrays import FloatArray

UNIT_CLEARANCE_RMS = 0.02
PAD_CLEARANCE_RMS = 0.01
"""Scatter of clearance from machine to machine and from pad to pad: how well wedges are set."""


@dataclass(frozen=True, eq=False)
class PadSetting:
    """How one machine's pads were set.

    Parameters
    ----------
    cold_um : (n_pads,)
        Cold clearance of each pad.
    opening_angle_rad
        Diameter along which the field of the generator stretches the housing.
    """

    cold_um: FloatArray
    opening_angle_rad: float = 0.0


@dataclass(frozen=True, eq=False)
class FilmCourse:
    """A film over time.

    Parameters
    ----------
    clearance_um : (n,)
        Mean over the pads.
    centre_um : (2, n)
        Shaft centre from bearing centre.
    """

    film: FilmColumns
    clearance_um: FloatArray
    centre_um: FloatArray


def even_setting(bearing: LifeBearing) -> PadSetting:
    """Pads exactly as the drawing says."""
    return PadSetting(np.full(bearing.ring.n_pads, bearing.cold_clearance_um))


def draw_setting(random: np.random.Generator, bearing: LifeBearing) -> PadSetting:
    """Draw how the pads of one machine were set."""
    each = 1.0 + PAD_CLEARANCE_RMS * random.standard_normal(bearing.ring.n_pads)
    whole = 1.0 + UNIT_CLEARANCE_RMS * random.standard_normal()
    angle_rad = float(random.uniform(0.0, math.pi))
    return PadSetting(bearing.cold_clearance_um * whole * each, angle_rad)


def film_course(
    bearing: LifeBearing,
    setting: PadSetting,
    thermal: ThermalCourse,
    speed_rpm: FloatArray,
    centre_um: FloatArray,
    altered: Alteration | None = None,
    worn: int = 0,
) -> FilmCourse:
    """Stiffness of a film where the shaft is put.

    Parameters
    ----------
    speed_rpm : (n,)
    centre_um : (2, n)
        Where the shaft runs if nothing is altered; it follows pads that wear.
    worn
        The pad whose pivot wears.
    """
    pads_um = _pad_clearance_um(bearing, setting, thermal)
    viscosity_pa_s = bearing.oil.viscosity_pa_s(thermal.oil_temperature_c)
    factor: FloatArray | float = 1.0
    if altered is not None:
        pads_um, centre_um = pads_um * altered.clearance, centre_um * altered.clearance
        pads_um[worn] += altered.pivot_share * bearing.told_clearance_um
        viscosity_pa_s = viscosity_pa_s * altered.viscosity
        factor = altered.stiffness
    film = bearing.ring.film(pads_um, centre_um, viscosity_pa_s, speed_rpm)
    scaled = (factor * k for k in (film.k_xx_n_per_m, film.k_xy_n_per_m, film.k_yy_n_per_m))
    return FilmCourse(FilmColumns(*scaled), np.mean(pads_um, axis=0), centre_um)


def mean_clearance_um(
    bearing: LifeBearing, setting: PadSetting, thermal: ThermalCourse
) -> FloatArray:
    """Mean over the pads, undamaged, (n,)."""
    return np.asarray(np.mean(_pad_clearance_um(bearing, setting, thermal), axis=0))


def _pad_clearance_um(
    bearing: LifeBearing, setting: PadSetting, thermal: ThermalCourse
) -> FloatArray:
    """Film thickness at each pivot with the shaft centred, (n_pads, n)."""
    ovality = np.cos(2.0 * (bearing.ring.pad_angles_rad - setting.opening_angle_rad))
    cold_um = setting.cold_um[:, np.newaxis]
    return cold_um - thermal.closing_um + ovality[:, np.newaxis] * thermal.opening_um


def worn_pad(bearing: LifeBearing, centre_um: FloatArray) -> int:
    """The pad that the shaft leans on most of the time, and wears."""
    x_um, y_um = np.median(centre_um, axis=1)
    angles = bearing.ring.pad_angles_rad
    return int(np.argmax(x_um * np.cos(angles) + y_um * np.sin(angles)))
