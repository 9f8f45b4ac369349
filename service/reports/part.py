"""What all parts of a bundle's document share."""

import math
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$", examples=["9f86d081884c7d65" * 4])]

Moment = Annotated[str, Field(examples=["2026-11-21T09:03:12.400Z"])]
"""UTC, RFC 3339."""

Numbers = list[float | None]
"""A column; null where there is no number."""


class EvidencePart(BaseModel):
    """Frozen, no unknown keys, no NaN or infinity; a field's docstring is its documentation."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True
    )


def finite(number: float | None) -> float | None:
    """Nothing, where JSON has no number for it."""
    return None if number is None or not math.isfinite(number) else float(number)


def rounded(number: float | None) -> float | None:
    """The same to seven digits: more than any result has, and half the space."""
    found = finite(number)
    return None if found is None else float(f"{found:.7g}")
