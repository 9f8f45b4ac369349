"""Baselines as JSON: written whole, and read back strictly or not at all."""

import json
from dataclasses import asdict
from typing import Any

from core.baseline.baseline import BearingBaseline
from core.baseline.strict import decode

FORMAT = "padwatch-baseline"
FORMAT_VERSION = 1


def to_json(baseline: BearingBaseline) -> str:
    """Write a baseline; `from_json` gives an equal one."""
    content = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "baseline": asdict(baseline),
    }
    return json.dumps(content, allow_nan=False)


def from_json(text: str) -> BearingBaseline:
    """Read a baseline.

    Raises
    ------
    ValueError
        If it is not JSON, of another format, or a key is missing, unknown, twice there or of the
        wrong kind; the message says where.
    """
    try:
        content = json.loads(text, object_pairs_hook=_no_twice, parse_constant=_no_constant)
    except RecursionError as error:
        raise ValueError("nested too deeply for a baseline") from error
    if not isinstance(content, dict) or set(content) != {"format", "format_version", "baseline"}:
        raise ValueError("not a baseline: expected keys format, format_version and baseline")
    if (content["format"], content["format_version"]) != (FORMAT, FORMAT_VERSION):
        raise ValueError(
            f"format {content['format']!r} version {content['format_version']!r}:"
            f" expected {FORMAT!r} version {FORMAT_VERSION}"
        )
    baseline: BearingBaseline = decode(BearingBaseline, content["baseline"], "baseline")
    return baseline


def _no_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError(f"a key is there twice among {[key for key, _ in pairs]}")
    return found


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number")
