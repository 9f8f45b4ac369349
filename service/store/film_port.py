"""Films in the store: readings, decisions, baselines and what was done to them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.baseline import BearingBaseline
from core.baseline.history import CodeArray, StiffnessHistory
from core.change.decision import Decision
from core.change.film_judge import FilmNews
from core.change.shaft_response import ShaftResponse
from core.condition.operating_state import OperatingState
from core.machine.unit import Estimator
from service.store.value_range import ValueRange


class Provenance(StrEnum):
    """Where readings come from: a machine's samples, or a simulation without samples."""

    MEASURED = "measured"
    SIMULATED = "simulated"


@dataclass(frozen=True)
class FilmQuery:
    """Which readings of a film are wanted, oldest first.

    Parameters
    ----------
    start_ns, end_ns
        From the first, up to but not including the second.
    states
        Operating states; empty for any.
    newest
        At most so many, the newest ones; None for all.
    """

    unit: str
    bearing: str
    estimator: Estimator
    start_ns: int = 0
    end_ns: int = 2**63 - 1
    states: tuple[OperatingState, ...] = ()
    eccentricity_ratio: ValueRange = field(default_factory=ValueRange)
    oil_temperature_c: ValueRange = field(default_factory=ValueRange)
    newest: int | None = None


@dataclass(frozen=True, eq=False)
class FilmHistory:
    """Readings of one film with what was said of them when they came in.

    Parameters
    ----------
    state, is_settled, is_simulated : (n,)
    verdict, level : (2, n)
        Members of `Verdict`, and of `AlarmLevel` or 0.
    change, change_std, deviation, deviation_std : (2, n)
        In ln; NaN where there is none.
    baseline_version : (n,)
        0 where there was none.
    """

    history: StiffnessHistory
    state: CodeArray
    is_settled: npt.NDArray[np.bool_]
    is_simulated: npt.NDArray[np.bool_]
    verdict: CodeArray
    level: CodeArray
    change: FloatArray
    change_std: FloatArray
    deviation: FloatArray
    deviation_std: FloatArray
    baseline_version: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.history)


@dataclass(frozen=True)
class StoredDecision:
    """Where the decision of one direction stood, and what with."""

    direction: str
    estimator: Estimator
    baseline_version: int | None
    decision: Decision


class BaselineStep(StrEnum):
    """What was done to the baselines of a bearing.

    The newest of `ACCEPTED` and `WITHDRAWN` says what is in force; `FROZEN` and `THAWED` whether
    it is learned any further; `RENEWED` from when on readings count for learning.
    """

    LEARNED = "learned"
    ACCEPTED = "accepted"
    REJECTED = "rejected"
    WITHDRAWN = "withdrawn"
    FROZEN = "frozen"
    THAWED = "thawed"
    RENEWED = "renewed"


@dataclass(frozen=True)
class StoredStep:
    """One step in the history of a bearing's baselines.

    Parameters
    ----------
    version
        Which baseline it was done to; None for `RENEWED`.
    from_ns
        From when on readings count, for `RENEWED`.
    """

    unit: str
    bearing: str
    version: int | None
    step: BaselineStep
    time_ns: int
    actor: str
    reason: str
    from_ns: int | None = None


@dataclass(frozen=True)
class BaselineEntry:
    """A stored baseline without its content."""

    unit: str
    bearing: str
    estimator: Estimator
    version: int
    created_ns: int
    author: str
    learned_from_ns: int
    learned_until_ns: int
    event: str


class FilmStore(Protocol):
    """Durable films. What a writing method has returned from is on the disk."""

    def add_simulated(self, readings: Iterable[FilmNews]) -> None:
        """Write readings of a simulation, marked as such."""
        ...

    def add_past(
        self,
        unit: str,
        bearing: str,
        estimator: Estimator,
        films: FilmHistory,
        values: Mapping[str, FloatArray],
    ) -> None:
        """Write a bearing's simulated past: readings of its film, and results for its trends.

        Parameters
        ----------
        values
            Of its trends by column of the store's layout; (n,) each, NaN where there is no number.
        """
        ...

    def past_end_ns(self, unit: str, bearing: str) -> int | None:
        """Until when a bearing's past is simulated; None if none of it is."""
        ...

    def history(self, query: FilmQuery) -> FilmHistory:
        """Read readings of one film, oldest first."""
        ...

    def first_ns(self, unit: str, bearing: str, estimator: Estimator) -> int | None:
        """Time of the first reading of a film."""
        ...

    def decisions(self, unit: str, bearing: str) -> Sequence[StoredDecision]:
        """Where the decisions of a bearing stood last."""
        ...

    def add_baseline(self, baseline: BearingBaseline, steps: Sequence[StoredStep]) -> None:
        """Write a learned baseline with what is done with it at once."""
        ...

    def baselines(self, unit: str, bearing: str) -> Sequence[BaselineEntry]:
        """Every baseline that was ever learned of a bearing, newest first."""
        ...

    def baseline(self, unit: str, bearing: str, version: int) -> BearingBaseline | None:
        """Read one baseline whole."""
        ...

    def add_steps(self, steps: Sequence[StoredStep]) -> None:
        """Write what was done to baselines."""
        ...

    def steps(self, unit: str, bearing: str) -> Sequence[StoredStep]:
        """What was done to the baselines of a bearing, oldest first."""
        ...

    def set_response(self, unit: str, response: ShaftResponse, now_ns: int) -> None:
        """Write how a unit's shaft answers to its films."""
        ...

    def responses(self) -> Mapping[str, ShaftResponse]:
        """How shafts answer, by unit."""
        ...
