"""What all settings models share."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, StringConstraints

Identifier = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,31}$")]
"""Letters, digits, dot, dash and underscore; at most 32; fit for a URL."""


class Settings(BaseModel):
    """Frozen, no unknown keys, no NaN or infinity; a field's docstring is its documentation."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True
    )
