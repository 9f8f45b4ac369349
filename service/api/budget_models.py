"""What the API answers about the uncertainty of one result."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.models import ApiModel, Time, UncertaintyModel


class BudgetLineModel(ApiModel):
    """One contribution to the uncertainty of a result."""

    name: Annotated[str, Field(examples=["bracket stiffness"])]
    """What contributes."""

    kind: Literal["random", "systematic"]
    """Whether it differs from one result to the next, or stays."""

    distribution: Literal["normal", "uniform"]
    """What is known about it besides its width."""

    width: float
    """Standard uncertainty if normal, half-width if uniform, in the unit of what contributes."""

    sensitivity: float
    """Change of the result per unit of what contributes."""

    contribution: float
    """Standard uncertainty of the result by this alone."""


class BudgetModel(ApiModel):
    """Where the uncertainty of one result comes from (JCGM 100:2008, "GUM")."""

    quantity: Annotated[str, Field(examples=["dynamic_k_xx_n_per_m"])]
    """Name from the catalogue."""

    unit: Annotated[str, Field(examples=["N/m"])]
    """Unit of the value and of the uncertainties."""

    time: Time
    """End of the samples."""

    value: float
    """The result."""

    uncertainty: UncertaintyModel
    """All contributions together."""

    lines: list[BudgetLineModel]
    """Each contribution, largest first."""
