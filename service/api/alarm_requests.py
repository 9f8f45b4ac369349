"""What people ask of alarms."""

from typing import Annotated

from pydantic import AfterValidator, Field, StringConstraints

from service.api.models import RequestModel


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("must be printable characters on one line")
    return text


Actor = Annotated[
    str,
    StringConstraints(strip_whitespace=True, min_length=1, max_length=80),
    AfterValidator(_printable),
    Field(examples=["A. Name"]),
]

Words = Annotated[
    str,
    StringConstraints(strip_whitespace=True, min_length=1, max_length=500),
    AfterValidator(_printable),
    Field(examples=["probe is being changed"]),
]

Comment = Annotated[
    str,
    StringConstraints(strip_whitespace=True, max_length=500),
    AfterValidator(_printable),
    Field(examples=["seen, shift engineer told"]),
]


class ActorModel(RequestModel):
    """Who does something to an alarm."""

    actor: Actor | None = None
    """Who, 1 to 80 printable characters; the name of a login or a key goes before it."""


class AcknowledgeModel(RequestModel):
    """That somebody has seen an occurrence of an alarm."""

    actor: Actor | None = None
    """Who, 1 to 80 printable characters; the name of a login or a key goes before it."""

    occurrence: Annotated[int, Field(ge=1, le=10**15, examples=[3])]
    """Which occurrence was seen: one that has come since is not acknowledged."""

    comment: Comment = ""
    """What to remember, at most 500 printable characters."""


class CommentModel(RequestModel):
    """What somebody has to say about an alarm."""

    actor: Actor | None = None
    """Who, 1 to 80 printable characters; the name of a login or a key goes before it."""

    text: Words
    """What, 1 to 500 printable characters."""


class ShelveModel(RequestModel):
    """That somebody takes an alarm off the list for a while."""

    actor: Actor | None = None
    """Who, 1 to 80 printable characters; the name of a login or a key goes before it."""

    reason: Words
    """Why, 1 to 500 printable characters."""

    duration_s: Annotated[float, Field(ge=1.0, le=31_536_000.0, examples=[3600.0])]
    """For how long, s; at most what the plant file allows."""


class OutageModel(RequestModel):
    """That somebody takes an alarm off the list until further notice."""

    actor: Actor | None = None
    """Who, 1 to 80 printable characters; the name of a login or a key goes before it."""

    reason: Words
    """Why, 1 to 500 printable characters."""
