"""True state of a life, and errors of the measuring chain."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from acquisition.simulated.life.damage import Alteration, Damage
from acquisition.simulated.life.operation import YEAR_S, Operation, wander
from acquisition.simulated.life.shaft import ConditionChange
from acquisition.simulated.plant.films import FilmColumns
from core.arrays import ComplexArray, FloatArray
from core.baseline.history import CodeArray, ReadingOutcome, StiffnessHistory

U_RANDOM_AT_REFERENCE = 0.005
REFERENCE_FORCE_N = 20.0e3
"""Relative random uncertainty of the estimator `dynamic` over 5 min, and the hydraulic force at
which it is valid (benchmarks/accuracy.py)."""

CK_SHARE, CK_CORRELATION = 1.5, -0.95
"""Random uncertainty of damping over stiffness, divided by that of stiffness, and correlation of
their errors, over 5 min with pads (`benchmarks/accuracy.py`)."""

U_RANDOM_KNOWN = 0.1
"""Relative error of the random uncertainty that a reading states."""

COMMON_ERRORS = ((4.0 * 3600.0, 0.004), (8.0 * 86_400.0, 0.003))
"""Time constant and relative rms of slow stiffness errors: transducers, excitation."""

CK_ERRORS = ((4.0 * 3600.0, 0.001), (8.0 * 86_400.0, 0.002))
"""As `COMMON_ERRORS`, of damping over stiffness. Assumption: gains cancel, and phases between probe
and accelerometer drift by 0.03° at 1×."""

GAIN_HALF_WIDTH = 0.05
"""Accuracy class of probes and accelerometers (Brito et al., section 2.2.1)."""

GAP_DRIFT = ((30.0 * 86_400.0, 0.8), (6.0 * 3600.0, 0.5), (600.0, 0.3))
"""Time constant and rms in µm of the displacement error of four probes. Assumption: a drift of
0.03 % of the gap of 2 mm per kelvin, mostly equal at opposite probes."""

REFERENCE_UM_RMS = 3.0
GAP_GAIN_HALF_WIDTH = 0.02

OIL_OFFSET_C_RMS = 0.4
OIL_WANDER = (86_400.0, 0.1)
OIL_RESOLUTION_C = 0.1

SHAFT_NOISE_UM, BEARING_NOISE_UM = 0.15, 0.02
RUNOUT_UM_PK = 1.0
"""Residual runout at 1× after subtraction of the slow-roll vector."""

NO_LOAD_SILENCE, LOADED_SILENCE = 0.08, 0.002
"""Share of readings with insufficient excitation, without load and with load."""

OUTAGES_PER_YEAR, OUTAGE_H = 3.0, (1.0, 10.0)
"""Number per year and duration of transducer outages in each direction."""


@dataclass(frozen=True, eq=False)
class Chain:
    """Errors of the transducers of one bearing.

    Parameters
    ----------
    probe_gain, gap_gain, accelerometer_gain : (2,)
        Ratio of true to configured sensitivity, without damage; `gap_gain` is for mean gaps.
    ln_k_error, ln_ck_error : (2, n)
        Logarithmic errors of stiffness and of damping over stiffness, correlated over hours and
        days.
    position_error_um : (2, n)
        Error of the shaft position measured by the gaps.
    oil_error_c : (n,)
        Error of the oil temperature.
    runout_um_pk : (2,)
        Phasors of the residual runout.
    evidence : (2, n)
        Outcomes of the readings, codes of `ReadingOutcome`.
    """

    probe_gain: FloatArray
    gap_gain: FloatArray
    accelerometer_gain: FloatArray
    ln_k_error: FloatArray
    ln_ck_error: FloatArray
    position_error_um: FloatArray
    oil_error_c: FloatArray
    runout_um_pk: ComplexArray
    evidence: CodeArray


def u_random(force_n: FloatArray) -> FloatArray:
    """Return the relative random uncertainty of stiffness, (n,).

    It is inversely proportional to the broadband hydraulic force `force_n` (rms), (n,).
    """
    return U_RANDOM_AT_REFERENCE * REFERENCE_FORCE_N / force_n


def draw_chain(random: np.random.Generator, operation: Operation) -> Chain:
    """Draw the errors of the measuring chain of one bearing."""
    n, step_s = len(operation), operation.step_s

    def wanders(
        parts: tuple[tuple[float, float], ...], draws: np.random.Generator = random
    ) -> FloatArray:
        return np.stack([sum((wander(draws, n, step_s, *p) for p in parts), 0.0) for _ in "xy"])

    position_error_um = wanders(GAP_DRIFT) + REFERENCE_UM_RMS * random.standard_normal((2, 1))
    phase = np.exp(2j * np.pi * random.uniform(size=2))
    return Chain(
        probe_gain=_gains(random, GAIN_HALF_WIDTH),
        gap_gain=_gains(random, GAP_GAIN_HALF_WIDTH),
        accelerometer_gain=_gains(random, GAIN_HALF_WIDTH),
        ln_k_error=wanders(COMMON_ERRORS),
        ln_ck_error=wanders(CK_ERRORS, random.spawn(1)[0]),
        position_error_um=position_error_um,
        oil_error_c=OIL_OFFSET_C_RMS * random.standard_normal()
        + wander(random, n, step_s, *OIL_WANDER),
        runout_um_pk=RUNOUT_UM_PK * random.uniform(size=2) * phase,
        evidence=np.stack([_evidence(random, operation) for _ in "xy"]),
    )


def _gains(random: np.random.Generator, half_width: float) -> FloatArray:
    return 1.0 + half_width * random.uniform(-1.0, 1.0, 2)


def _evidence(random: np.random.Generator, operation: Operation) -> CodeArray:
    n = len(operation)
    silence = np.where(operation.load < 0.05, NO_LOAD_SILENCE, LOADED_SILENCE)
    evidence = np.full(n, ReadingOutcome.MEASURED, np.int8)
    evidence[random.random(n) < silence] = ReadingOutcome.INSUFFICIENT_EXCITATION
    evidence[_is_out_of_order(random, n, operation.step_s)] = ReadingOutcome.BAD_QUALITY
    evidence[~operation.is_at_speed] = ReadingOutcome.BAD_QUALITY
    return evidence


def _is_out_of_order(random: np.random.Generator, n: int, step_s: float) -> npt.NDArray[np.bool_]:
    is_out = np.zeros(n, np.bool_)
    for first in random.integers(0, n, random.poisson(OUTAGES_PER_YEAR * n * step_s / YEAR_S)):
        is_out[first : first + int(3600.0 * random.uniform(*OUTAGE_H) / step_s)] = True
    return is_out


@dataclass(frozen=True, eq=False)
class BearingMoments:
    """True state of one bearing at n times.

    Parameters
    ----------
    clearance_um, oil_temperature_c : (n,)
        Mean clearance of the pads, and oil temperature.
    centre_um : (2, n)
        Position of the shaft centre relative to the bearing centre.
    altered
        Effect of damage on film, bracket and transducers.
    chain
        Errors of the transducers.
    """

    film: FilmColumns
    clearance_um: FloatArray
    centre_um: FloatArray
    oil_temperature_c: FloatArray
    altered: Alteration
    chain: Chain


@dataclass(frozen=True, eq=False)
class BearingLifeTruth(BearingMoments):
    """True state of one bearing at the rows of its readings, with stiffness and 1× response.

    Parameters
    ----------
    ln_k, ln_k_healthy : (2, n)
        Logarithm of the film stiffness in N/m, with and without damage.
    ln_ck : (2, n)
        Logarithm of damping over stiffness in s.
    order1_um_pk : (4, n)
        Phasors of u_x, u_y, x_b, y_b at 1×.
    """

    ln_k: FloatArray
    ln_k_healthy: FloatArray
    ln_ck: FloatArray
    order1_um_pk: ComplexArray

    @property
    def eccentricity_ratio(self) -> FloatArray:
        """Ratio of the shaft centre displacement to the true clearance, (n,)."""
        return np.asarray(np.hypot(*self.centre_um) / self.clearance_um)

    @property
    def film_loss(self) -> FloatArray:
        """Relative loss of film stiffness by damage, (2, n)."""
        return np.asarray(1.0 - np.exp(self.ln_k - self.ln_k_healthy))


@dataclass(frozen=True, eq=False)
class UnitLife:
    """Simulated life of one unit: readings and true state by bearing.

    Parameters
    ----------
    operation
        Operation at the rows of the readings, while the shaft turns; unevenly spaced.
    grade_mm_s, water_c : (n,)
        Residual unbalance and cooling water temperature at these rows.
    """

    unit_seed: int
    operation: Operation
    grade_mm_s: FloatArray
    water_c: FloatArray
    readings: Mapping[str, StiffnessHistory]
    truth: Mapping[str, BearingLifeTruth]
    damage: tuple[Damage, ...]
    changes: tuple[ConditionChange, ...]
