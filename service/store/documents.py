"""JSON documents of baselines, shaft responses and decisions, validated when they are read."""

import json
from dataclasses import asdict
from typing import Generic, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from core.baseline.baseline import BearingBaseline
from core.change.decision import Decision
from core.change.shaft_response import ShaftResponse

BASELINE = "padwatch-baseline"
FORMATS: dict[type, str] = {
    BearingBaseline: BASELINE,
    ShaftResponse: "padwatch-shaft-response",
    Decision: "padwatch-decision",
}
FORMAT_VERSION = 1

T = TypeVar("T")


class _Document(BaseModel, Generic[T]):
    """Envelope of a JSON document; its pydantic configuration also applies to `content`."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)

    format: str
    format_version: Literal[1]
    content: T


def to_json(value: BearingBaseline | ShaftResponse | Decision) -> str:
    """Return a value as a JSON document.

    Raises `ValueError` if a number in the value is not finite.
    """
    whole = {"format": FORMATS[type(value)], "format_version": FORMAT_VERSION}
    return json.dumps(whole | {"content": asdict(value)}, allow_nan=False)


def from_json(kind: type[T], text: str) -> T:
    """Return the value of type `kind` in a JSON document.

    Raises
    ------
    ValueError
        If the text is not JSON or has another format, or a key is missing or unknown, or its
        value has the wrong type; the message names the key.
    """
    try:
        found: _Document[T] = _Document[kind].model_validate_json(text)  # type: ignore[valid-type]
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "document"
        words = first["msg"].removeprefix("Value error, ")
        raise ValueError(f"{where}: {words} (found {first['input']!r:.50})") from error
    if found.format != FORMATS[kind]:
        raise ValueError(f"format: must be {FORMATS[kind]!r} (found {found.format!r:.50})")
    return found.content
