"""Oil films of a simulated life: clearances and stiffness; rows of dataclasses of arrays."""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from acquisition.simulated.life.bearing import LifeBearing, ThermalCourse
from acquisition.simulated.life.damage import Alteration
from acquisition.simulated.plant.films import FilmColumns
from core.arrays import FloatArray

UNIT_CLEARANCE_RMS = 0.02
PAD_CLEARANCE_RMS = 0.01
"""Relative rms differences in clearance between machines and between pads: wedge accuracy."""


@dataclass(frozen=True, eq=False)
class PadSetting:
    """Pad clearances of one bearing of one machine.

    Parameters
    ----------
    cold_um : (n_pads,)
        Cold clearance of each pad.
    opening_angle_rad
        Angle of the diameter in which the magnetic field of the generator moves the pads outward.
    """

    cold_um: FloatArray
    opening_angle_rad: float = 0.0


@dataclass(frozen=True, eq=False)
class FilmCourse:
    """Time series of a film, with its clearance and shaft position.

    Parameters
    ----------
    clearance_um : (n,)
        Mean clearance of the pads.
    centre_um : (2, n)
        Position of the shaft centre relative to the bearing centre.
    """

    film: FilmColumns
    clearance_um: FloatArray
    centre_um: FloatArray


def draw_setting(random: np.random.Generator, bearing: LifeBearing) -> PadSetting:
    """Draw random pad clearances of a bearing, as set in one machine."""
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
    """Return film stiffness, mean clearance and shaft position of a bearing over time.

    Parameters
    ----------
    speed_rpm : (n,)
        Running speed.
    centre_um : (2, n)
        Shaft position without damage; it increases in proportion to a clearance grown by damage.
    altered
        Effect of damage; None without damage.
    worn
        Index of the pad with a worn pivot.
    """
    pads_um = _pad_clearance_um(bearing, setting, thermal)
    viscosity_pa_s = bearing.oil.viscosity_pa_s(thermal.oil_temperature_c)
    if altered is not None:
        pads_um, centre_um = pads_um * altered.clearance, centre_um * altered.clearance
        pads_um[worn] += altered.pivot_share * bearing.configured_clearance_um
        viscosity_pa_s = viscosity_pa_s * altered.viscosity
        viscosity_pa_s = viscosity_pa_s * altered.stiffness  # scales all forces
    film = bearing.ring.film(pads_um, centre_um, viscosity_pa_s, speed_rpm)
    return FilmCourse(film, np.mean(pads_um, axis=0), centre_um)


def mean_clearance_um(
    bearing: LifeBearing, setting: PadSetting, thermal: ThermalCourse
) -> FloatArray:
    """Return the mean clearance of the pads without damage, (n,)."""
    return np.asarray(np.mean(_pad_clearance_um(bearing, setting, thermal), axis=0))


def _pad_clearance_um(
    bearing: LifeBearing, setting: PadSetting, thermal: ThermalCourse
) -> FloatArray:
    """Return the film thickness at each pivot with a centred shaft, (n_pads, n)."""
    ovality = np.cos(2.0 * (bearing.ring.pad_angles_rad - setting.opening_angle_rad))
    cold_um = setting.cold_um[:, np.newaxis]
    return cold_um - thermal.closing_um + ovality[:, np.newaxis] * thermal.opening_um


def worn_pad(bearing: LifeBearing, centre_um: FloatArray) -> int:
    """Return the index of the pad that wears: nearest to the median of `centre_um` (2, n)."""
    x_um, y_um = np.median(centre_um, axis=1)
    angles = bearing.ring.pad_angles_rad
    return int(np.argmax(x_um * np.cos(angles) + y_um * np.sin(angles)))


T = TypeVar("T")
Column: TypeAlias = npt.NDArray[Any]
"""Array of numbers or codes with rows along the last axis."""


def rows_of(columns: T, rows: npt.NDArray[np.bool_]) -> T:
    """Return a copy of a dataclass of arrays, with selected rows of all arrays.

    Parameters
    ----------
    rows : (n,)
        Mask of the selected rows. Rows lie along the last axis; arrays with a last axis of another
        length are unchanged.
    """
    return _mapped(columns, rows.size, lambda value: value[..., rows])


def row_between(columns: T, n: int, row: int, share: float) -> T:
    """Return a copy of a dataclass of arrays with one row, interpolated between two rows.

    Parameters
    ----------
    n
        Number of rows of `columns`.
    share
        Fraction of the interval from `row` to the next row; 0 is `row` itself. Integers and codes
        are taken from `row`.
    """

    def between(value: Column) -> Column:
        here, there = value[..., row : row + 1], value[..., row + 1 : row + 2]
        if share == 0.0 or not np.issubdtype(value.dtype, np.inexact):
            return here
        return np.asarray((1.0 - share) * here + share * there)

    return _mapped(columns, n, between)


def _mapped(columns: T, n: int, change: Callable[[Column], Column]) -> T:
    if not is_dataclass(columns) or isinstance(columns, type):
        raise TypeError(f"{type(columns).__name__} has no columns")
    chosen = {}
    for field in fields(columns):
        value = getattr(columns, field.name)
        if isinstance(value, np.ndarray) and value.shape[-1] == n:
            value = change(value)
        chosen[field.name] = value
    return type(columns)(**chosen)
