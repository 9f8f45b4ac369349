"""Line of a stiff shaft through three bearings, which a changed transducer breaks.

The absolute motion of the shaft, probe plus accelerometer, at three heights lies on a line. The 1×
phasors of each direction therefore satisfy one linear equation, which contains no film, force or
bracket. Its coefficients, which contain the heights and the gains of the transducers, and the
runout are learned from a healthy machine. A shaft that bends satisfies no such equation.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from core.arrays import BoolArray, ComplexArray, FloatArray
from core.baseline.history import DIRECTIONS, StiffnessHistory

MEANS_OF = 24
"""Number of readings averaged for a comparison with the line: four hours."""

MIN_READINGS = 1200
"""Number of settled readings required to learn a line."""

LASTING = 0.03
"""Fraction of the variance of such means that further averaging does not reduce, as assumed."""

WINDOWS = (96, 288, 864)
"""Numbers of newest readings averaged to find a broken line: 16 h, 48 h and 6 days."""

PARTS, ROUNDS = 6, 4
"""Number of folds of the cross-validation, and of reweightings of the robust fit."""

FAR = 4.0
"""Distance from the line, in medians, beyond which means are not used for the fit."""

PROBE_NOISE = 6.0
"""Noise of probes divided by that of accelerometers, in displacement at 1×."""

MAX_GAIN_DIFFERENCE = 0.3
"""Largest relative difference of the fitted gains of accelerometer and probe of a bearing. Beyond
it the readings do not determine the line, or there is none."""

MIN_STD_UM = 0.005
"""Smallest scatter of the line."""

MAX_STD_SHARE = 0.01
"""Largest scatter of the line relative to the shaft's motion; beyond it the shaft is not stiff."""

HOLDS, BROKEN = 3.5, 6.0
"""Distance from the line, in standard uncertainties, up to which it holds, and from which it is
broken."""

MINOR = 0.3
"""Largest distance from the line, relative to that of a gain that explains the largest change of k,
up to which the line holds nevertheless: a changed motion shows errors of the fitted line."""

MIN_PROBE_RISE = 0.2
"""Smallest change of ln k per change of ln of a probe's gain that is assumed. A learned surface may
fall with eccentricity by chance, and then no gain would be too large to explain a change."""

GAIN_SPREAD, GAIN_STD = 0.25, 0.012
"""Standard uncertainty of the gain that a change of stiffness predicts: relative, and absolute."""

MIN_GAIN_CHANGE = 0.03
"""Smallest relative change of a gain that raises an alert: that of the limit of k, without its
margin, because the line determines gains better than a baseline does k."""

PHASE_SPREAD = 0.1
"""Standard uncertainty of the direction in which a changed gain moves the sum, rad."""

FITS, CLEAR = 16.0, 6.0
"""Largest misfit of a changed gain that is named, as the sum of squares in standard uncertainties,
and smallest difference to the misfit of any other transducer."""


class LineVerdict(StrEnum):
    """Verdict of the shaft line on the transducers of one bearing in one direction."""

    UNKNOWN = "unknown"
    HOLDS = "holds"
    BROKEN = "broken"
    PROBE = "probe"
    ACCELEROMETER = "accelerometer"


@dataclass(frozen=True)
class LineFinding:
    """Verdict on transducers, and distance of the motion from the line with its uncertainty.

    Parameters
    ----------
    distance_um, std_um
        Distance from the line, and its standard uncertainty; None if unknown.
    bearing, ln_gain
        Bearing of the transducer that changed its gain, and ln of its gain over the learned gain;
        None unless the verdict is `PROBE` or `ACCELEROMETER`.
    """

    verdict: LineVerdict = LineVerdict.UNKNOWN
    distance_um: float | None = None
    std_um: float | None = None
    bearing: str | None = None
    ln_gain: float | None = None

    @property
    def significance(self) -> float:
        """Distance divided by its standard uncertainty; 0 if unknown."""
        return (self.distance_um or 0.0) / (self.std_um or 1.0)

    @property
    def is_alarming(self) -> bool:
        """Whether the gain of a transducer has changed by at least `MIN_GAIN_CHANGE`."""
        return self.ln_gain is not None and abs(math.expm1(self.ln_gain)) >= MIN_GAIN_CHANGE

    @property
    def words(self) -> str:
        """Gain, and distance from the line of the shaft, as text; empty if unknown."""
        if self.distance_um is None:
            return ""
        gain = "" if self.ln_gain is None else f"{100.0 * math.expm1(self.ln_gain):+.1f} %, "
        return f"{gain}{self.distance_um:.2f} ± {self.std_um:.2f} µm off the line of the shaft"


@dataclass(frozen=True)
class ShaftLine:
    """Learned linear equation of the 1× motion of a stiff shaft at three bearings, by direction.

    Parameters
    ----------
    bearings
        Bearing ids, in the order of the coefficients.
    probe, accelerometer
        Coefficients of the 1× phasors of the shaft relative to each bearing, and of the bearing.
    offset_um
        Real and imaginary part of the sum of the terms, which is due to runout.
    std_um
        Cross-validated scatter of the means of `MEANS_OF` readings.
    """

    direction: str
    bearings: tuple[str, ...]
    probe: tuple[float, ...]
    accelerometer: tuple[float, ...]
    offset_um: tuple[float, float]
    std_um: float

    def judge(
        self, shaft: ComplexArray, motion: ComplexArray, ln_k: FloatArray, rise: FloatArray
    ) -> LineFinding:
        """Return the finding on the transducers from the mean motion over the longest of `WINDOWS`.

        If the motion is off the line in any window, the window with the highest significance
        counts.

        Parameters
        ----------
        shaft, motion : (n_bearings, n)
            1× phasors in µm of the shaft relative to the bearings, and of the bearings; NaN if
            unknown.
        ln_k : (n_bearings, n)
            Changes of ln of the stiffness in this direction; NaN if unknown.
        rise : (n_bearings, n)
            Change of the expected ln k per change of ln of the probe's gain; NaN if unknown.
        """
        usable = np.flatnonzero(np.all(np.isfinite(shaft) & np.isfinite(motion), axis=0))
        found = [
            self._finding(shaft[:, rows], motion[:, rows], ln_k[:, rows], rise[:, rows])
            for rows in (usable[-n:] for n in WINDOWS)
            if rows.size
        ]
        broken = [each for each in found if each.significance >= BROKEN]
        usual = found[-1] if found else LineFinding()
        return max(broken, key=lambda each: each.significance, default=usual)

    def _finding(
        self, shaft: ComplexArray, motion: ComplexArray, ln_k: FloatArray, rise: FloatArray
    ) -> LineFinding:
        std = self.std_um * max(MEANS_OF / shaft.shape[1], LASTING) ** 0.5
        signals = np.array(
            [self.probe * shaft.mean(axis=1), self.accelerometer * motion.mean(axis=1)]
        )
        off = complex(signals.sum()) - complex(*self.offset_um)
        change, rises = _known_mean(ln_k), np.nan_to_num(_known_mean(rise))
        largest = int(np.argmax(np.abs(np.nan_to_num(change))))
        shows = np.min(np.abs(np.expm1(change[largest]) * signals[:, largest]))
        is_near = abs(off) <= max(HOLDS * std, MINOR * shows)
        holds = LineVerdict.HOLDS if is_near and shows >= BROKEN * std else LineVerdict.UNKNOWN
        if abs(off) < BROKEN * std:
            return LineFinding(holds, abs(off), std)
        effects = np.array([-np.maximum(1.0 + rises, MIN_PROBE_RISE), np.ones(len(rises))])
        gains, misfits = _gains(off, std, signals, change, effects)
        best, other = np.argsort(misfits, axis=None)[:2]
        if not misfits.flat[best] <= min(FITS, misfits.flat[other] - CLEAR):
            return LineFinding(LineVerdict.HOLDS if is_near else LineVerdict.BROKEN, abs(off), std)
        part, row = divmod(int(best), len(self.bearings))
        verdict = (LineVerdict.PROBE, LineVerdict.ACCELEROMETER)[part]
        return LineFinding(verdict, abs(off), std, self.bearings[row], float(gains.flat[best]))


def _known_mean(values: FloatArray) -> FloatArray:
    """Return the mean (n_bearings,) of the values that are known; NaN if none is."""
    known = np.isfinite(values)
    n = known.sum(axis=1)
    return np.where(n > 0, np.where(known, values, 0.0).sum(axis=1) / np.maximum(n, 1), np.nan)


def _gains(
    off: complex, std: float, signals: ComplexArray, change: FloatArray, effects: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return ln of the gain by which each transducer alone explains a broken line, and the misfit.

    The arrays are (2, n_bearings), for probes and accelerometers. `effects` is the change of ln k
    of the bearing per ln gain; films of the other bearings do not change. The misfit is a sum of
    squares in standard uncertainties: infinite if the change of the bearing's ln k is unknown.
    """
    ratio = off / signals  # of a signal that already has the gain
    along, across = ratio.real, ratio.imag * np.abs(signals)
    gains = -np.log1p(-np.clip(along, -1.0, 0.5))
    across_std = np.hypot(std, PHASE_SPREAD * np.abs(gains * signals))
    k_std = np.hypot(GAIN_STD, GAIN_SPREAD * gains * effects)
    unchanged = np.nan_to_num(change / GAIN_STD) ** 2
    own = ((change - gains * effects) / k_std) ** 2 + 2.0 * np.log(k_std / GAIN_STD)
    misfits = (across / across_std) ** 2 + own + unchanged.sum() - unchanged
    return gains, np.where(np.isfinite(misfits) & (np.abs(along) < 0.5), misfits, np.inf)


def learn_lines(
    histories: Mapping[str, StiffnessHistory], is_settled: BoolArray
) -> tuple[ShaftLine, ...]:
    """Learn the lines of a shaft from histories by bearing id, at common times.

    Only the times selected by `is_settled` (n,) are used. No line is learned without phases, if the
    unit does not have three bearings, or in a direction whose motion does not fit a line.
    """
    if len(histories) != 3:
        return ()
    lines = []
    for row, direction in enumerate(DIRECTIONS):
        motion = np.stack([history.motion_um[:, row] for history in histories.values()])
        usable = is_settled & np.all(np.isfinite(motion), axis=(0, 1))
        if np.sum(usable) >= MIN_READINGS:
            found = _learned(direction, tuple(histories), motion[:, :, usable])
            lines += [] if found is None else [found]
    return tuple(lines)


def _learned(direction: str, bearings: Sequence[str], motion: ComplexArray) -> ShaftLine | None:
    """Return the line fitted to phasors (3, 2, n) of shaft and bearing; None if there is none."""
    n = motion.shape[-1] // MEANS_OF
    means = motion[..., : n * MEANS_OF].reshape(*motion.shape[:2], n, MEANS_OF).mean(axis=-1)
    signals = np.concatenate([means[:, 0], means[:, 1]])
    left = np.empty(n, dtype=np.complex128)
    for part in np.array_split(np.arange(n), PARTS):
        coefficients, offset = _fit(np.delete(signals, part, axis=1))
        left[part] = coefficients @ signals[:, part] - offset
    coefficients, offset = _fit(signals)
    std_um = max(float(np.sqrt(np.mean(np.abs(left) ** 2))), MIN_STD_UM)
    probe, accelerometer = np.split(coefficients, 2)
    is_line = std_um <= MAX_STD_SHARE * float(np.median(np.abs(signals[0] + signals[3])))
    is_line &= bool(np.all(np.abs(accelerometer / probe - 1.0) <= MAX_GAIN_DIFFERENCE))
    if not is_line:
        return None
    columns = tuple(probe.tolist()), tuple(accelerometer.tolist())
    return ShaftLine(direction, tuple(bearings), *columns, (offset.real, offset.imag), std_um)


def _fit(signals: ComplexArray) -> tuple[FloatArray, complex]:
    """Return the coefficients (6,) whose sum of signals (6, n) is closest to a constant, and it.

    All signals have errors: the smallest ratio of the variance of the sum to that of its errors is
    an eigenvalue (total least squares). Means far from the line are left out.
    """
    from scipy.linalg import eigh  # slow import, not needed at start-up

    kept = np.ones(signals.shape[1], dtype=np.bool_)
    noise = np.diag([PROBE_NOISE**2] * 3 + [1.0] * 3)
    coefficients, offset = np.ones(6), 0j
    for _ in range(ROUNDS):
        middle = np.mean(signals[:, kept], axis=1, keepdims=True)
        centred = signals[:, kept] - middle
        _, vectors = eigh((centred @ centred.conj().T).real, noise)
        coefficients = vectors[:, 0] / vectors[0, 0]
        offset = complex((coefficients @ middle)[0])
        distance = np.abs(coefficients @ signals - offset)
        kept = distance <= FAR * np.median(distance)
    return coefficients, offset
