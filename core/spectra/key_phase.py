"""Angle and speed of the shaft from a channel with one pulse a turn; or why there are none.

The whole segment must bear out that the pulses are one a turn: a pulse lost, one too many or one
out of place makes every phase that follows from it a guess, and so there is none.
"""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.units import rpm_from_hz

HYSTERESIS = 0.2
"""A pulse begins this share of its height above the middle, and ends as much below it."""

MIN_PULSES = 4
"""Three turns; fewer would not show an odd one out."""

MAX_DEPARTURE_TURNS = 0.02
"""Farthest that a pulse may lie from its place in an even turning, 7°."""

ODD_TURN = (0.75, 1.5)
"""A turn shorter or longer than these shares of the middle one holds a pulse too many or too
few."""

OUTER_TURN = 1.1
"""The first and the last pulse lie no more turns than this from the ends of the segment."""


class KeyPhaseFault(StrEnum):
    """Why there is no shaft angle."""

    TOO_FEW_PULSES = "too_few_pulses"
    MISSING_PULSE = "missing_pulse"
    EXTRA_PULSE = "extra_pulse"
    IRREGULAR = "irregular"


@dataclass(frozen=True)
class KeyPhase:
    """How the shaft turned during a segment.

    Parameters
    ----------
    shaft_angle_rad
        Angle that it has turned at the first sample since the mark passed the pick-up, 0 to 2π.
    speed_rpm
        Mean over the segment.
    u_relative
        Standard uncertainty of the speed, relative, by how far the pulses lie from an even turning.
    n_pulses
        Pulses in the segment.
    """

    shaft_angle_rad: float
    speed_rpm: float
    u_relative: float = 0.0
    n_pulses: int = 0


def read_key_phase(signal: FloatArray, rate_hz: float) -> KeyPhase | KeyPhaseFault:
    """Fit an even turning to the pulses of a segment.

    Parameters
    ----------
    signal
        (n_samples,) with pulses that rise; the mark passes where they begin.

    Returns
    -------
    The first thing that is wrong, if anything is.
    """
    edges = rising_edges(signal)
    if edges.size < MIN_PULSES:
        return KeyPhaseFault.TOO_FEW_PULSES
    fault = _odd_turn(edges, signal.size)
    if fault is not None:
        return fault
    # The error lies in where a pulse is found, so that positions are fitted over turns.
    turns = np.arange(edges.size) - (edges.size - 1) / 2.0
    samples_per_turn = float(turns @ edges / (turns @ turns))
    middle = float(edges.mean())
    departure = (edges - middle - samples_per_turn * turns) / samples_per_turn
    if np.abs(departure).max() > MAX_DEPARTURE_TURNS:
        return KeyPhaseFault.IRREGULAR
    # slope of a line (Bevington and Robinson 2003, equation 6.23); an edge is known to a sample
    resolution = samples_per_turn**-2 / 12.0
    variance = float(departure @ departure) / (edges.size - 2) + resolution
    turns_at_start = -middle / samples_per_turn - float(turns[0])  # since the first pulse
    return KeyPhase(
        shaft_angle_rad=2.0 * math.pi * (turns_at_start % 1.0),
        speed_rpm=rpm_from_hz(rate_hz / samples_per_turn),
        u_relative=math.sqrt(variance / (turns @ turns)),
        n_pulses=edges.size,
    )


def rising_edges(signal: FloatArray) -> FloatArray:
    """Where a signal rises through the middle between its extremes, in samples, between them too.

    Parameters
    ----------
    signal : (n_samples,)

    Returns
    -------
    (n_edges,) rising; noise smaller than the hysteresis makes no edge.
    """
    low, high = float(signal.min()), float(signal.max())
    middle, margin = (low + high) / 2.0, HYSTERESIS * (high - low)
    if margin == 0.0:
        return np.empty(0)
    clear = np.flatnonzero(np.abs(signal - middle) > margin)
    is_high = signal[clear] > middle
    begins = clear[1:][is_high[1:] & ~is_high[:-1]]
    under: npt.NDArray[np.intp] = np.flatnonzero(signal <= middle)
    last = under[np.searchsorted(under, begins) - 1]
    edges: FloatArray = last + (middle - signal[last]) / (signal[last + 1] - signal[last])
    return edges


def _odd_turn(edges: FloatArray, n_samples: int) -> KeyPhaseFault | None:
    intervals = np.diff(edges)
    usual = float(np.median(intervals))
    shortest, longest = ODD_TURN[0] * usual, ODD_TURN[1] * usual
    if intervals.min() < shortest:
        return KeyPhaseFault.EXTRA_PULSE
    # a train that begins late or breaks off lacks pulses as well
    outer = max(edges[0], n_samples - 1 - edges[-1])
    if intervals.max() > longest or outer > OUTER_TURN * usual:
        return KeyPhaseFault.MISSING_PULSE
    return None
