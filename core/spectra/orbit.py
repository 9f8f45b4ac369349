"""The shaft's path in its bearing, sample by sample: whole, at running speed alone, and its marks.

Samples that are missing are NaN throughout; what is made of too few of them is NaN, too.
"""

import math
from dataclasses import dataclass

import numpy as np

from core.arrays import ComplexArray, FloatArray
from core.spectra.speed import ODD_TURN, rising_edges

FILTER_TURNS = 8.0
"""Width of the taper in which 1× is read: its first zeros are a quarter of the running speed away
from 1×, so that a vortex at 0.25× has none of it left."""

MIN_WEIGHT = 0.5
"""Share of the taper that must lie on samples."""


@dataclass(frozen=True)
class Ellipse:
    """The path of a shaft that moves with one frequency.

    Parameters
    ----------
    major_um_pk, minor_um_pk
        Half axes.
    angle_deg
        Of the major axis, from x towards y, -90 to 90.
    sense
        +1 if it runs from x to y, -1 from y to x, 0 on a straight line.
    """

    major_um_pk: float
    minor_um_pk: float
    angle_deg: float
    sense: int


def order_phasors(trace_um: FloatArray, rate_hz: float, frequency_hz: float) -> ComplexArray:
    """Phasor of one frequency at each sample, over a taper of `FILTER_TURNS` turns around it.

    Parameters
    ----------
    trace_um : (n_samples,)
        Mean removed; NaN where there is no sample.
    frequency_hz
        Must lie above zero and below ``rate_hz / 2``.

    Returns
    -------
    (n_samples,) of zero-to-peak phasors ``P`` with ``x(t) = Re(P exp(iωt))``, t from the first
    sample; NaN where too little of the taper lies on samples.

    Raises
    ------
    ValueError
        If the frequency is out of range; the message gives it and the limit.
    """
    if not 0.0 < frequency_hz < rate_hz / 2.0:
        raise ValueError(
            f"frequency {frequency_hz:g} Hz must lie within 0 and {rate_hz / 2.0:g} Hz"
        )
    half = max(1, round(FILTER_TURNS / 2.0 * rate_hz / frequency_hz))
    taper = np.hanning(2 * half + 1)
    there = np.isfinite(trace_um)
    turned = np.where(there, trace_um, 0.0) * np.exp(
        -2.0j * math.pi * frequency_hz / rate_hz * np.arange(trace_um.size)
    )
    from scipy.signal import oaconvolve  # slow to load, and not needed to begin

    weight = oaconvolve(there.astype(np.float64), taper, mode="same")
    total = oaconvolve(turned, taper, mode="same")
    phasors: ComplexArray = np.full(trace_um.size, np.nan, dtype=np.complex128)
    enough = weight >= MIN_WEIGHT * taper.sum()
    phasors[enough] = 2.0 * total[enough] / weight[enough]
    return phasors


def trace_of(phasors: ComplexArray, rate_hz: float, frequency_hz: float) -> FloatArray:
    """Motion of the phasors of `order_phasors`, (n_samples,) µm."""
    angle = 2.0 * math.pi * frequency_hz / rate_hz * np.arange(phasors.size)
    trace: FloatArray = (phasors * np.exp(1.0j * angle)).real
    return trace


def ellipse_of(x: complex, y: complex) -> Ellipse:
    """Path of a shaft from its phasors in x and y.

    The motion x + iy is a forward circle and a backward circle (Childs 1993, section 1.9): the half
    axes are the sum and the difference of their radii.
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
    """Where the mark of the shaft passes a key-phase pick-up.

    Parameters
    ----------
    signal : (n_samples,)
        With pulses that rise; NaN where there is no sample.

    Returns
    -------
    (n_marks,) in samples from the first, between them too; none where the pulses are not one a
    turn: a shaft at rest makes noise, not marks.
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
