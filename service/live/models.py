"""Models of values that the answers of the API and the evidence of alarms share."""

from typing import Annotated, Literal

from pydantic import Field

from service.runtime.models import Finite, Time, ValueModel


class BudgetLineModel(ValueModel):
    """Contribution of one source of uncertainty to the uncertainty of a result."""

    name: Annotated[str, Field(examples=["bracket stiffness"])]
    """Name of the source of uncertainty."""

    kind: Literal["random", "systematic"]
    """Kind of error: random if it differs between results, systematic if it is constant."""

    distribution: Literal["normal", "uniform"]
    """Assumed distribution of the error."""

    width: float
    """Standard uncertainty (normal) or half-width (uniform) of the source, in its own unit."""

    sensitivity: float
    """Sensitivity coefficient: change of the result divided by the change of the source."""

    contribution: float
    """Standard uncertainty of the result due to this source alone, in the unit of the result."""


class FilmCauseModel(ValueModel):
    """Cause of a change, inferred from damping over stiffness and the motion of the shaft."""

    cause: Literal[
        "film", "oil", "clearance", "bracket", "transducer", "bracket_or_transducer", "unknown"
    ]
    """Cause: film of this bearing, oil, clearance or wear, bracket, transducer, bracket or
    transducer, or unknown."""

    reason: str
    """Reason why this cause was inferred, with its numbers."""

    film_share: Finite
    """Fraction of the change that is due to the film if a transducer error causes the rest, 0 to 1
    within its uncertainty; null if unknown, or if no such combination explains the motion."""

    film_share_std: Finite
    """Standard uncertainty of `film_share`; null if `film_share` is null."""


class BaselineOriginModel(ValueModel):
    """Version, author, time and learning period of a baseline."""

    version: Annotated[int, Field(examples=[3])]
    """Number of the version, from 1."""

    author: str
    """Person or program that started the learning."""

    created: Time
    """Time when the baseline was learned, by the host clock."""

    learned_from: Time
    """Time of the first reading of the learning period."""

    learned_until: Time
    """Time of the last reading of the learning period."""

    event: str
    """Machine event that made this version necessary; empty without an event."""
