"""Base class of the settings models, their validation errors, and shared checks."""

import ast
import inspect
import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import fields
from functools import cache
from itertools import pairwise
from textwrap import dedent
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, field_validator

CONTROL = re.compile(r"[\x00-\x08\x0a-\x1f\x7f-\x9f]")
"""Control characters except the tab, which is a valid column delimiter of an imported file."""


class MisfitError(ValueError):
    """Validation error: a value is invalid, or contradicts other values of the file.

    Parameters
    ----------
    message
        Predicate of the value, such as "must be above 0", without the value and its key.
    at
        Location of the value relative to the model that raises the error: keys and array indices.
    """

    def __init__(self, message: str, *at: int | str) -> None:
        super().__init__(message)
        self.at = at


class MissingError(MisfitError):
    """Validation error: a key is missing that other keys require; ``at`` ends with the key.

    The message begins with "is missing".
    """


class SecretMisfitError(MisfitError):
    """Validation error whose message omits the value, because the value may contain a secret."""


Identifier = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,31}$")]
"""Identifier of letters, digits, dot, dash and underscore; at most 32 characters."""


Share = Annotated[float, Field(gt=0.0, lt=1.0)]
"""Fraction between 0 and 1, both excluded."""


def describe_fields(schema: dict[str, Any], model: type[Any]) -> None:
    """Add the docstrings of the fields of a model to its JSON schema, as their descriptions.

    pydantic's ``use_attribute_docstrings`` reads them when a class is made, which takes a quarter
    of the start of a process, although few processes make a schema.
    """
    properties = schema.get("properties", {})
    for kind in model.__mro__:
        for name, words in _docstrings_of(kind).items():
            served = name if name in properties else name.removesuffix("_ns")
            if served in properties:
                properties[served].setdefault("description", words)


@cache  # most models have the same base classes, whose source is long
def _docstrings_of(kind: type[Any]) -> dict[str, str]:
    """Return the docstrings of the fields that a class itself defines, by field."""
    found = {}
    with suppress(OSError, TypeError):  # its source does not exist
        [definition] = ast.parse(dedent(inspect.getsource(kind))).body
        for field, text in pairwise(getattr(definition, "body", ())):
            match field, text:
                case ast.AnnAssign(ast.Name(name)), ast.Expr(ast.Constant(str(words))):
                    found[name] = inspect.cleandoc(words)
    return found


class Settings(BaseModel):
    """Base class of all settings: frozen; unknown keys, NaN and infinity are errors."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        json_schema_extra=describe_fields,
        defer_build=True,  # most models are only part of another, which contains their validators
    )

    @field_validator("*")
    @classmethod
    def _has_no_control_characters(cls, value: Any) -> Any:
        """Refuse control characters: names are printed, and paths must not contain NUL."""
        if isinstance(value, str) and CONTROL.search(value):
            raise SecretMisfitError("must not contain control characters")
        return value

    def values_for(self, kind: type[Any]) -> dict[str, Any]:
        """Return the values of the keys that are fields of the dataclass ``kind``, by key."""
        return self.model_dump(include={field.name for field in fields(kind)})


def refuse_twice(entries: Iterable[tuple[int | str, ...]]) -> None:
    """Raise `MisfitError` if a value occurs twice; an entry is a location followed by its value."""
    seen: set[int | str] = set()
    for *at, value in entries:
        if value in seen:
            raise MisfitError("is used twice; each value must be unique", *at)
        seen.add(value)


def refuse_unknown_units(units: Iterable[str], known: Iterable[str], *at: int | str) -> None:
    """Raise `MisfitError` if one of ``units``, a list at location ``at``, is not ``known``."""
    for n, unit in enumerate(units):
        if unit not in known:
            raise MisfitError(f"unknown unit; known units: {', '.join(known)}", *at, n)
