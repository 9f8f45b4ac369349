"""Base of the models of answers and documents, and configuration of served dataclasses."""

import math
from enum import Enum
from types import SimpleNamespace
from typing import Annotated, Any, Self

from pydantic import (
    AliasChoices,
    AliasGenerator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
)

from service.runtime.times import rfc3339
from service.settings.base import describe_fields


class ValueModel(BaseModel):
    """Base class of models that reject unknown members, NaN and infinity.

    JSON schemas show the docstrings of the fields as their descriptions.

    A model can be built from the attributes of an object: a field is read from the attribute with
    its name, or for times from the attribute with its name and the suffix ``_ns``.
    """

    model_config = ConfigDict(
        extra="forbid",
        allow_inf_nan=False,
        json_schema_extra=describe_fields,
        from_attributes=True,
        populate_by_name=True,
        alias_generator=AliasGenerator(validation_alias=lambda n: AliasChoices(n, f"{n}_ns")),
    )

    @classmethod
    def of(cls, *sources: object, **values: object) -> Self:
        """Return a model; each field is from `values`, else from the first source that has it."""
        return cls.model_validate(_Merged(SimpleNamespace(**values), *sources))


SERVED = ConfigDict(
    **{
        **ValueModel.model_config,
        "alias_generator": AliasGenerator(serialization_alias=lambda n: n.removesuffix("_ns")),
    }
)
"""Configuration, as ``__pydantic_config__``, of dataclasses that answers of the API contain.

The names of times in JSON lack the suffix ``_ns``. The docstrings of the fields are descriptions in
the JSON schema."""


class _Merged:
    """Object with the attributes of several objects; the first object with an attribute decides."""

    def __init__(self, *sources: object) -> None:
        self._sources = sources

    def __getattr__(self, name: str) -> Any:
        for source in self._sources:
            if (value := getattr(source, name, ...)) is not ...:
                return value
        raise AttributeError(name)


def _time(value: object) -> object:
    return rfc3339(value) if isinstance(value, int) else value


def _name(value: object) -> object:
    return value.name.lower() if isinstance(value, Enum) else value


def _finite(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value


Time = Annotated[str, BeforeValidator(_time), Field(examples=["2026-11-21T09:03:12.400Z"])]
"""Type of a time in RFC 3339; nanoseconds since 1970 UTC are converted."""

TimeNs = Annotated[
    int,
    PlainSerializer(rfc3339, return_type=str),
    Field(examples=["2026-11-21T09:03:12.400Z"]),
]
"""Type of a time in nanoseconds since 1970 UTC, which JSON contains in RFC 3339."""

NotServed = Field(exclude=True)
"""Annotation of a field of a served dataclass that JSON does not contain."""

ByName = BeforeValidator(_name)
"""Validator that converts a member of an enumeration to its name in lower case."""

Finite = Annotated[float | None, BeforeValidator(_finite)]
"""Type of a number; NaN and infinity are converted to None."""
