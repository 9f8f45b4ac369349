"""Baselines as JSON: written whole, and read back strictly or not at all."""

import json
from dataclasses import asdict
from typing import Any

from core.baseline.baseline import BearingBaseline
from core.baseline.response import ShaftResponse
from core.baseline.strict import decode

BASELINE, RESPONSE = "padwatch-baseline", "padwatch-shaft-response"
FORMAT_VERSION = 1


def to_json(baseline: BearingBaseline) -> str:
    """Write a baseline; `from_json` gives an equal one."""
    return written(BASELINE, baseline)


def from_json(text: str) -> BearingBaseline:
    """Read a baseline.

    Raises
    ------
    ValueError
        If it is not JSON, of another format, or a key is missing, unknown, twice there or of the
        wrong kind; the message says where.
    """
    baseline: BearingBaseline = decode(BearingBaseline, content(text, BASELINE), "content")
    return baseline


def response_to_json(response: ShaftResponse) -> str:
    """Write the response of a shaft; `response_from_json` gives an equal one."""
    return written(RESPONSE, response)


def response_from_json(text: str) -> ShaftResponse:
    """Read the response of a shaft; raises as `from_json` does."""
    response: ShaftResponse = decode(ShaftResponse, content(text, RESPONSE), "content")
    return response


def written(name: str, value: Any) -> str:
    """Write a frozen dataclass as a document of a format.

    Raises
    ------
    ValueError
        If a number in it is not finite.
    """
    whole = {"format": name, "format_version": FORMAT_VERSION, "content": asdict(value)}
    return json.dumps(whole, allow_nan=False)


def content(text: str, name: str) -> object:
    """What is in a document of a format; raises as `from_json` does."""
    try:
        whole = json.loads(text, object_pairs_hook=_no_twice, parse_constant=_no_constant)
    except RecursionError as error:
        raise ValueError(f"nested too deeply for a {name}") from error
    if not isinstance(whole, dict) or set(whole) != {"format", "format_version", "content"}:
        raise ValueError(f"not a {name}: expected keys format, format_version and content")
    if (whole["format"], whole["format_version"]) != (name, FORMAT_VERSION):
        raise ValueError(
            f"format {whole['format']!r} version {whole['format_version']!r}:"
            f" expected {name!r} version {FORMAT_VERSION}"
        )
    return whole["content"]


def _no_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError(f"a key is there twice among {[key for key, _ in pairs]}")
    return found


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number")
