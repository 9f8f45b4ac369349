"""What all settings models share."""

import re
from collections.abc import Iterable
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, StringConstraints, field_validator

CONTROL = re.compile(r"[\x00-\x08\x0a-\x1f\x7f-\x9f]")
"""All but the tab, by which columns of a file to import may be separated."""


class MisfitError(ValueError):
    """A value that does not fit what stands elsewhere in the file.

    Parameters
    ----------
    at
        Where the value stands, seen from the model that found it: keys and element numbers.
    """

    def __init__(self, message: str, *at: int | str) -> None:
        super().__init__(message)
        self.at = at


class MissingError(MisfitError):
    """A key that is needed beside others that stand in the file."""


class SecretMisfitError(MisfitError):
    """A value that does not fit and may hold a secret: it is not shown."""


Identifier = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,31}$")]
"""Letters, digits, dot, dash and underscore; at most 32; fit for a URL."""


class Settings(BaseModel):
    """Frozen, no unknown keys, no NaN or infinity; a field's docstring is its documentation."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True
    )

    @field_validator("*")
    @classmethod
    def _has_no_control_characters(cls, value: Any) -> Any:
        """Refuse them in names, which are printed, and in paths, which cannot have a NUL."""
        if isinstance(value, str) and CONTROL.search(value):
            raise SecretMisfitError("must not have control characters")
        return value


def refuse_twice(entries: Iterable[tuple[int | str, ...]]) -> None:
    """Refuse a value that was already given elsewhere; entries are its place, then the value."""
    seen: set[int | str] = set()
    for *at, value in entries:
        if value in seen:
            raise MisfitError("is used twice; each must be unique", *at)
        seen.add(value)
