"""What is really so through a life: the answers a decision is held against."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from acquisition.simulated.life.condition_change import ConditionChange
from acquisition.simulated.life.damage import Alteration, Damage
from acquisition.simulated.life.measured import Chain
from acquisition.simulated.life.operation import Operation
from acquisition.simulated.plant.tilting_pad import FilmColumns
from core.arrays import ComplexArray, FloatArray
from core.baseline.stiffness_history import StiffnessHistory


@dataclass(frozen=True, eq=False)
class BearingMoments:
    """All of one bearing that samples depend on, row by row.

    Parameters
    ----------
    clearance_um : (n,)
        Mean over the pads.
    centre_um : (2, n)
        Shaft centre from bearing centre.
    oil_temperature_c : (n,)
    altered
        What damage has done to film, bracket and transducers.
    chain
        What the transducers make of it.
    """

    film: FilmColumns
    clearance_um: FloatArray
    centre_um: FloatArray
    oil_temperature_c: FloatArray
    altered: Alteration
    chain: Chain


@dataclass(frozen=True, eq=False)
class BearingLifeTruth(BearingMoments):
    """One bearing; rows are those of its readings.

    Parameters
    ----------
    ln_k, ln_k_healthy : (2, n)
        Of the film as it is, and as it would be without damage.
    order1_um_pk : (4, n)
        Phasors of u_x, u_y, x_b, y_b at 1×.
    """

    ln_k: FloatArray
    ln_k_healthy: FloatArray
    order1_um_pk: ComplexArray

    @property
    def eccentricity_ratio(self) -> FloatArray:
        """(n,) distance of the shaft centre over the clearance that there is."""
        return np.asarray(np.hypot(*self.centre_um) / self.clearance_um)

    @property
    def film_loss(self) -> FloatArray:
        """(2, n) share of stiffness that damage has taken from the film."""
        return np.asarray(1.0 - np.exp(self.ln_k - self.ln_k_healthy))


@dataclass(frozen=True, eq=False)
class UnitLife:
    """Years of one unit.

    Parameters
    ----------
    operation
        At the rows of the readings: while the shaft turns. Its times are not evenly spaced.
    grade_mm_s, water_c : (n,)
        Residual unbalance and cooling water at these rows.
    readings, truth
        By bearing.
    """

    unit_seed: int
    operation: Operation
    grade_mm_s: FloatArray
    water_c: FloatArray
    readings: Mapping[str, StiffnessHistory]
    truth: Mapping[str, BearingLifeTruth]
    damage: tuple[Damage, ...]
    changes: tuple[ConditionChange, ...]

    def is_damaged(self) -> npt.NDArray[np.bool_]:
        """(n,) whether any damage has set in."""
        time_ns = self.operation.time_ns
        onsets = [damage.onset_ns for damage in self.damage]
        return np.asarray(time_ns >= min(onsets, default=int(time_ns[-1]) + 1))
