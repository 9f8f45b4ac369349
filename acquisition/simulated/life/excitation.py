"""What shakes a unit over the years: residual unbalance, turbulence, the part-load vortex."""

import numpy as np

from acquisition.simulated.life.operation import Operation
from acquisition.simulated.life.wander import lagged, wander
from core.arrays import FloatArray

WARM_UNBALANCE = 0.76
"""Unbalance of the warm rotor over that of the cold one.

Fitted: with the films of Table 8 (Brito et al.) alone, shaft motion at the UJB falls from 85 to
51 µm. Bearing motion fell with it, in both bearings and directions, which no film explains.
"""

WARM_UNBALANCE_TIME_S = 1.2 * 3600.0
STANDING_TIME_FACTOR = 10.0

BALANCED_GRADES_MM_S = (0.8, 2.0)
MAGNETIC_UNBALANCE = 0.12
"""What the field adds to unbalance at full load."""

GRADE_WANDER, GRADE_TIME_S = 0.03, 5.0 * 86_400.0

NO_LOAD_FORCE_N = 6.0e3
FULL_LOAD_FORCE_N = 20.0e3
"""Broadband hydraulic force, rms: the latter is what the design's accuracy trial took."""

VORTEX_LOADS = (0.35, 0.65)
"""Share of rated power between which a Francis turbine has its vortex (320 MW of 700 in Brito et
al., section 3.2)."""

VORTEX_FORCE_N = 60.0e3
VORTEX_TURBULENCE = 1.6
"""By how much more turbulent the flow is there."""


def warm_unbalance(operation: Operation) -> FloatArray:
    """Unbalance over that of the cold rotor, as the rotor warms and cools, (n,)."""
    turns = operation.is_turning
    time_s = WARM_UNBALANCE_TIME_S * np.where(turns, 1.0, STANDING_TIME_FACTOR)
    return lagged(np.where(turns, WARM_UNBALANCE, 1.0), time_s, operation.step_s, 1.0)


def draw_grade_mm_s(random: np.random.Generator, operation: Operation) -> FloatArray:
    """Draw the residual unbalance of a balanced machine, as an ISO grade, (n,)."""
    cold_mm_s = random.uniform(*BALANCED_GRADES_MM_S) / WARM_UNBALANCE
    magnetic = 1.0 + MAGNETIC_UNBALANCE * operation.load
    slow = wander(random, len(operation), operation.step_s, GRADE_TIME_S, GRADE_WANDER)
    return np.asarray(cold_mm_s * warm_unbalance(operation) * magnetic * np.exp(slow))


def has_vortex(load: FloatArray) -> FloatArray:
    """(n,) 1 where the part-load vortex is, rising and falling over a twentieth of rated power."""
    least, most = VORTEX_LOADS
    rising = np.clip((load - least) / 0.05, 0.0, 1.0)
    return rising * np.clip((most - load) / 0.05, 0.0, 1.0)


def hydraulic_force_n(load: FloatArray) -> FloatArray:
    """Rms of the broadband hydraulic force in each direction, (n,)."""
    smooth_n = NO_LOAD_FORCE_N + (FULL_LOAD_FORCE_N - NO_LOAD_FORCE_N) * np.clip(load, 0.0, 1.0)
    return smooth_n * (1.0 + (VORTEX_TURBULENCE - 1.0) * has_vortex(load))
