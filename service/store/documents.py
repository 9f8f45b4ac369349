"""JSON documents of baselines, shaft responses and decisions, validated when they are read."""

import json
from dataclasses import asdict
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from core.baseline.baseline import BearingBaseline
from core.change.decision import Decision
from core.change.shaft_response import ShaftResponse

BASELINE, RESPONSE, DECISION = "padwatch-baseline", "padwatch-shaft-response", "padwatch-decision"
FORMAT_VERSION = 1

_Model = TypeVar("_Model", bound=BaseModel)


class _Document(BaseModel):
    """Envelope of a JSON document; its pydantic configuration also applies to `content`."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)

    format_version: Literal[1]


class _BaselineDocument(_Document):
    format: Literal["padwatch-baseline"]
    content: BearingBaseline


class _ResponseDocument(_Document):
    format: Literal["padwatch-shaft-response"]
    content: ShaftResponse


class _DecisionDocument(_Document):
    format: Literal["padwatch-decision"]
    content: Decision


def to_json(value: BearingBaseline | ShaftResponse | Decision) -> str:
    """Return a value as a JSON document.

    Raises
    ------
    ValueError
        If a number in the value is not finite.
    """
    names = {BearingBaseline: BASELINE, ShaftResponse: RESPONSE, Decision: DECISION}
    whole = {"format": names[type(value)], "format_version": FORMAT_VERSION}
    return json.dumps(whole | {"content": asdict(value)}, allow_nan=False)


def baseline_from_json(text: str) -> BearingBaseline:
    """Return the baseline in a JSON document.

    Raises
    ------
    ValueError
        If the text is not JSON or has another format, or a key is missing, unknown or repeated, or
        its value has the wrong type; the message names the key.
    """
    return _read(_BaselineDocument, text).content


def response_from_json(text: str) -> ShaftResponse:
    """Return the shaft response in a JSON document; raises like `baseline_from_json`."""
    return _read(_ResponseDocument, text).content


def decision_from_json(text: str) -> Decision:
    """Return the decision in a JSON document; raises like `baseline_from_json`."""
    return _read(_DecisionDocument, text).content


def _read(model: type[_Model], text: str) -> _Model:
    try:
        found = model.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "document"
        words = first["msg"].removeprefix("Value error, ")
        raise ValueError(f"{where}: {words} (found {first['input']!r:.50})") from error
    json.loads(text, object_pairs_hook=_refuse_repeated_keys)  # pydantic accepts repeated keys
    return found


def _refuse_repeated_keys(pairs: list[tuple[str, Any]]) -> None:
    keys = [key for key, _ in pairs]
    if len(set(keys)) < len(keys):
        raise ValueError(f"a key is repeated among {', '.join(keys)}")
