"""Published coefficients of oil films, at the size of a guide bearing.

Forces are scaled so that the direct dynamic stiffness in x is 0.7 GN/m at the running speed; the
ratios of all eight coefficients are those of the tables.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from acquisition.simulated.plant.films import Film
from core.units import rad_s_from_rpm

# Lund and Thomsen, A calculation method and data for the dynamic coefficients of oil-lubricated
# journal bearings, ASME 1978: K = k Cp / W and B = c Cp ω / W with x along the load. Sommerfeld
# number: Kxx, Kxy, Kyx, Kyy, Bxx, Bxy = Byx, Byy.
LUND_THOMSEN = {
    "two axial grooves, L/D = 0.5": {
        1.656: (1.69, 5.06, -2.20, 1.95, 9.93, 2.15, 4.80),
        0.917: (2.12, 4.01, -1.30, 1.85, 7.70, 2.06, 3.23),
        0.580: (2.67, 3.70, -0.78, 1.75, 6.96, 1.94, 2.40),
        0.379: (3.33, 3.64, -0.43, 1.68, 6.76, 1.87, 1.89),
        0.244: (4.21, 3.74, -0.13, 1.64, 6.87, 1.82, 1.54),
    },
    "two axial grooves, L/D = 1": {
        0.991: (1.56, 7.29, -2.16, 1.52, 14.66, 1.58, 4.49),
        0.635: (1.62, 5.33, -1.57, 1.56, 10.80, 1.70, 3.41),
        0.235: (2.19, 3.57, -0.80, 1.55, 7.36, 1.89, 2.19),
        0.159: (2.73, 3.36, -0.48, 1.48, 6.94, 1.78, 1.74),
        0.108: (3.45, 3.34, -0.23, 1.44, 6.89, 1.72, 1.43),
    },
    "elliptical, L/D = 1": {
        0.211: (6.65, 4.36, -3.21, 0.86, 13.09, -2.23, 3.70),
        0.161: (5.63, 3.84, -2.32, 1.01, 10.75, -1.02, 3.07),
        0.120: (4.99, 3.54, -1.52, 1.14, 9.04, -0.01, 2.49),
        0.097: (4.82, 3.46, -1.01, 1.21, 8.26, 0.56, 2.10),
    },
}

# Nicholas, Barrett and Leader, Experimental-theoretical comparison of instability onset speeds for
# a three mass rotor supported by step journal bearings, ASME J. Mech. Des. 102 (1980), tables 4
# and 5: pressure dams, in lbf/in and lbf·s/in. Speed in r/min: kxx, kxy, kyx, kyy, cxx, cxy = cyx,
# cyy.
NICHOLAS = {
    "set 1, bearing 1": {
        8000.0: (6.82e4, 1.64e4, -2.43e5, 6.68e4, 125.0, -59.0, 443.0),
        16000.0: (13.44e4, 2.94e4, -4.77e5, 13.26e4, 122.0, -57.0, 441.0),
    },
    "set 1, bearing 2": {8000.0: (5.24e4, 1.00e4, -1.56e5, 5.44e4, 86.0, -47.0, 291.0)},
}

DIRECT_N_PER_M = 0.7e9
SPEED_RPM = 92.3


def _film(row: tuple[float, ...], speed_rad_s: float) -> Film:
    """Return the film of a row of a table, whose dampings are for an angular velocity."""
    k, (c_xx, c_xy, c_yy) = np.array(row[:4]), row[4:]
    c = np.array([c_xx, c_xy, c_xy, c_yy]) * speed_rad_s
    scale = DIRECT_N_PER_M / math.hypot(k[0], c[0])
    return Film(*(scale * k).tolist(), *(scale * c / rad_s_from_rpm(SPEED_RPM)).tolist())


PUBLISHED: Mapping[str, Film] = MappingProxyType(
    {
        **{
            f"{name}, S = {sommerfeld}": _film(row, 1.0)
            for name, rows in LUND_THOMSEN.items()
            for sommerfeld, row in rows.items()
        },
        **{
            f"{name}, {rpm:.0f} r/min": _film(row, rad_s_from_rpm(rpm))
            for name, rows in NICHOLAS.items()
            for rpm, row in rows.items()
        },
    }
)
"""Films by table, bearing and operating point: 14 rows and 3 rows."""
