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
import numpy.typing as npt

from core.arrays import ComplexArray, FloatArray
from core.baseline.history import DIRECTIONS, StiffnessHistory

MEANS_OF = 24
"""Number of readings averaged for a comparison with the line: four hours."""

MIN_READINGS = 1200
"""Number of settled readings required to learn a line."""

LASTING = 0.06
"""Fraction of the variance of such means that further averaging does not reduce, as assumed."""

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

MIN_PROBE_RISE = 0.2
"""Smallest change of ln k per change of ln of a probe's gain that is assumed. A learned surface may
fall with eccentricity by chance, and then no gain would be too large to explain a change."""

GAIN_SPREAD, GAIN_STD = 0.25, 0.012
"""Standard uncertainty of the gain that a change of stiffness predicts: relative, and absolute."""

PHASE_SPREAD = 0.1
"""Standard uncertainty of the direction in which a changed gain moves the sum, rad."""

FITS, CLEAR = 3.0, 3.0
"""Largest distance of a broken line from that of a changed gain, in standard uncertainties, and
smallest difference of the log likelihoods of both gains."""


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

    The fields in µm are None if unknown.
    """

    verdict: LineVerdict = LineVerdict.UNKNOWN
    distance_um: float | None = None
    std_um: float | None = None

    @property
    def words(self) -> str:
        """Distance from the line of the shaft ± standard uncertainty as text; empty if unknown."""
        if self.distance_um is None:
            return ""
        return f"{self.distance_um:.2f} ± {self.std_um:.2f} µm off the line of the shaft"


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
        Runout, real and imaginary part: with it, the sum is zero.
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
        self, bearing: str, shaft: ComplexArray, motion: ComplexArray, ln_k: float, rise: float
    ) -> LineFinding:
        """Return the finding on the transducers of a bearing whose stiffness has changed.

        Parameters
        ----------
        shaft, motion : (n_bearings, n)
            1× phasors in µm of the shaft relative to the bearings, and of the bearings; NaN if
            unknown.
        ln_k
            Change of ln of the bearing's stiffness in this direction.
        rise
            Change of the expected ln k per change of ln of the probe's gain.
        """
        usable = np.all(np.isfinite(shaft) & np.isfinite(motion), axis=0)
        if not usable.any():
            return LineFinding()
        shaft, motion = np.mean(shaft[:, usable], axis=1), np.mean(motion[:, usable], axis=1)
        off = complex(np.array(self.probe) @ shaft + np.array(self.accelerometer) @ motion)
        off -= complex(*self.offset_um)
        std = self.std_um * max(MEANS_OF / int(usable.sum()), LASTING) ** 0.5
        row = self.bearings.index(bearing)
        gains = {
            LineVerdict.PROBE: (
                -ln_k / max(1.0 + rise, MIN_PROBE_RISE),
                self.probe[row] * shaft[row],
            ),
            LineVerdict.ACCELEROMETER: (ln_k, self.accelerometer[row] * motion[row]),
        }
        return LineFinding(_verdict(off, std, gains), abs(off), std)


def _verdict(
    off: complex, std: float, gains: Mapping[LineVerdict, tuple[float, complex]]
) -> LineVerdict:
    distance, score = {}, {}
    for which, (ln_gain, signal) in gains.items():
        step = -math.expm1(-ln_gain) * signal  # of a signal that already has the gain
        along = math.hypot(std, abs(signal) * math.hypot(GAIN_SPREAD * ln_gain, GAIN_STD))
        across = math.hypot(std, PHASE_SPREAD * abs(step))
        rest = (off - step) * signal.conjugate() / abs(signal)  # a gain moves along its signal
        distance[which] = math.hypot(rest.real / along, rest.imag / across)
        score[which] = distance[which] ** 2 / 2.0 + math.log(along * across)
    if abs(off) < BROKEN * std:
        shows = min(abs(math.expm1(gain) * signal) for gain, signal in gains.values())
        is_sure = abs(off) <= HOLDS * std and shows >= BROKEN * std
        return LineVerdict.HOLDS if is_sure else LineVerdict.UNKNOWN
    best, other = sorted(score, key=score.__getitem__)
    is_clear = distance[best] <= FITS and score[other] - score[best] >= CLEAR
    return best if is_clear else LineVerdict.BROKEN


def learn_lines(
    histories: Mapping[str, StiffnessHistory], is_settled: npt.NDArray[np.bool_]
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
    found = _fit(signals)
    left = np.empty(n, dtype=np.complex128)
    for part in np.array_split(np.arange(n), PARTS):
        coefficients, offset = _fit(np.delete(signals, part, axis=1))
        left[part] = coefficients @ signals[:, part] - offset
    coefficients, offset = found
    std_um = max(float(np.sqrt(np.mean(np.abs(left) ** 2))), MIN_STD_UM)
    probe, accelerometer = np.split(coefficients, 2)
    is_line = std_um <= MAX_STD_SHARE * float(np.median(np.abs(signals[0] + signals[3])))
    is_line &= bool(np.all(np.abs(accelerometer / probe - 1.0) <= MAX_GAIN_DIFFERENCE))
    return (
        ShaftLine(
            direction,
            tuple(bearings),
            tuple(probe.tolist()),
            tuple(accelerometer.tolist()),
            (offset.real, offset.imag),
            std_um,
        )
        if is_line
        else None
    )


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
