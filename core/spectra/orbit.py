"""Shaft orbit in its bearing, sample by sample: unfiltered, 1×-filtered, and key-phase marks.

Missing samples are NaN; so are results computed from too few samples.
"""

import math
from dataclasses import dataclass

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.spectra.speed import ODD_TURN, rising_edges

FILTER_TURNS = 8.0
"""Width of the taper of the 1× filter in turns. Its zeros are 0.25 orders from 1× and every 1/8
order beyond; a vortex at 0.25× falls on one."""

MIN_WEIGHT = 0.5
"""Fraction of the taper's weight that must fall on existing samples."""


@dataclass(frozen=True)
class Ellipse:
    """Elliptical orbit of a shaft at one frequency.

    Parameters
    ----------
    major_um_pk, minor_um_pk
        Semi-axes.
    angle_deg
        Angle of the major axis, from x towards y, -90 to 90.
    sense
        Sense of rotation: +1 from x to y, -1 from y to x, 0 for a straight line.
    """

    major_um_pk: float
    minor_um_pk: float
    angle_deg: float
    sense: int


def order_phasors(trace_um: FloatArray, rate_hz: float, frequency_hz: float) -> ComplexArray:
    """Return the phasor at one frequency at each sample, from `FILTER_TURNS` turns around it.

    Parameters
    ----------
    trace_um : (n_samples,)
        Displacement without mean; NaN for missing samples.
    rate_hz, frequency_hz
        Sampling rate, and frequency above zero and below ``rate_hz / 2``.

    Returns
    -------
    (n_samples,) zero-to-peak phasors ``P`` with ``x(t) = Re(P exp(iωt))``, t from the first sample;
    NaN where too many samples are missing.
    """
    half = max(1, round(FILTER_TURNS / 2.0 * rate_hz / frequency_hz))
    taper = np.hanning(2 * half + 1)
    there = np.isfinite(trace_um)
    turned = np.where(there, trace_um, 0.0) * np.exp(
        -2.0j * math.pi * frequency_hz / rate_hz * np.arange(trace_um.size)
    )
    from scipy.signal import oaconvolve  # slow import, not needed at start

    weight = oaconvolve(there.astype(np.float64), taper, mode="same")
    total = oaconvolve(turned, taper, mode="same")
    phasors: ComplexArray = np.full(trace_um.size, np.nan, dtype=np.complex128)
    enough = weight >= MIN_WEIGHT * taper.sum()
    phasors[enough] = 2.0 * total[enough] / weight[enough]
    return phasors


def trace_of(phasors: ComplexArray, rate_hz: float, frequency_hz: float) -> FloatArray:
    """Return the filtered displacement (n_samples,), µm, from the phasors of `order_phasors`."""
    angle = 2.0 * math.pi * frequency_hz / rate_hz * np.arange(phasors.size)
    return np.asarray((phasors * np.exp(1.0j * angle)).real)


def ellipse_of(x: complex, y: complex) -> Ellipse:
    """Return the elliptical orbit of a shaft from its displacement phasors in x and y, µm 0-pk.

    The motion x + iy is the sum of a forward and a backward circle (Childs 1993, section 1.9). The
    semi-axes are the sum and the difference of their radii.
    """
    forward, backward = (x + 1.0j * y) / 2.0, (x.conjugate() + 1.0j * y.conjugate()) / 2.0
    along, against = abs(forward), abs(backward)
    angle_deg = math.degrees(np.angle(forward) + np.angle(backward)) / 2.0
    return Ellipse(
        major_um_pk=along + against,
        minor_um_pk=abs(along - against),
        angle_deg=(angle_deg + 90.0) % 180.0 - 90.0,
        sense=int(np.sign(round(along - against, 9))),
    )


def marks_of(signal: FloatArray) -> FloatArray:
    """Return the positions at which the shaft's mark passes the key-phase pick-up.

    The pulses of `signal` (n_samples,) rise when the mark passes; missing samples are NaN.

    Returns
    -------
    (n_marks,) fractional sample positions; empty if there is not exactly one pulse per turn, as
    with the noise of a shaft at rest.
    """
    there = np.flatnonzero(np.isfinite(signal))
    if there.size < 2:
        return np.empty(0)
    found = rising_edges(signal[there])
    before = there[np.floor(found).astype(np.int64)]
    after = there[np.minimum(np.ceil(found).astype(np.int64), there.size - 1)]
    edges = (before + found % 1.0)[after - before <= 1]
    turns = np.diff(edges)
    if turns.size == 0:
        return edges
    shortest, longest = (share * float(np.median(turns)) for share in ODD_TURN)
    is_even = turns.min() >= shortest and (there.size < signal.size or turns.max() <= longest)
    return edges if is_even else np.empty(0)
