"""What is wrong with a plant file, in one line each: key, value, what is allowed."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from pydantic_core import ErrorDetails

from service.settings.base import MisfitError, MissingError, SecretMisfitError
from service.settings.positions import Location
from service.settings.schema import description, known_keys

MAX_SHOWN = 60
"""Characters of a wrong value that are shown."""

UNION_ERRORS = ("union_tag_invalid", "union_tag_not_found")


def is_echo(error: ErrorDetails) -> bool:
    """Whether a list is only called too short because its elements are wrong, as said elsewhere."""
    return error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]


def located(error: ErrorDetails, data: Mapping[str, Any]) -> Location:
    """Where in the file a mistake is."""
    location = _without_tags(error["loc"], data)
    reason = error.get("ctx", {}).get("error")
    if isinstance(reason, MisfitError):
        location += reason.at
    return (*location, "kind") if error["type"] in UNION_ERRORS else location


def sentence(error: ErrorDetails, location: Location, data: Mapping[str, Any]) -> str:
    """The mistake in words."""
    key = "".join(_step(part) for part in location).lstrip(".")
    found, value = _value(data, location)
    shown = f"{key} = {_shown(value)}"
    meaning = description(location)
    if error["type"] == "extra_forbidden":
        return f"{shown}: unknown key; known here: {', '.join(known_keys(location[:-1]))}"
    is_missing = isinstance(error.get("ctx", {}).get("error"), MissingError)
    if error["type"] == "value_error" and not is_missing:
        if isinstance(error["ctx"]["error"], SecretMisfitError):
            return f"{key}: {error['ctx']['error']}"
        return f"{shown if found else f'{key} (by default)'}: {error['ctx']['error']}"
    if not found:
        problem = f"{key} is missing"
    elif error["type"] == "union_tag_invalid":
        problem = f"{shown}: must be {error['ctx']['expected_tags'].replace(', ', ' or ')}"
    else:
        problem = f"{shown}: {error['msg']}"
    return f"{problem} — {meaning}" if meaning else problem


def _step(part: int | str) -> str:
    """One step of a place; a key may be any text, but a message stays one line."""
    if isinstance(part, int):
        return f"[{part + 1}]"
    return f".{part}" if part.isprintable() else f".{part!r}"


def _shown(value: Any) -> str:
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    text = value.isoformat() if isinstance(value, datetime) else text
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}…"


def _value(data: Any, location: Location) -> tuple[bool, Any]:
    """Whether the file has something there, and what."""
    for part in location:
        inside = isinstance(data, dict) and part in data
        listed = isinstance(data, list) and isinstance(part, int) and part < len(data)
        if not inside and not listed:
            return False, None
        data = data[part]
    return True, data


def _without_tags(location: Location, data: Any) -> Location:
    """Drop what pydantic puts into a location beside the file's own keys: union tags."""
    kept: Location = ()
    for part in location:
        _, table = _value(data, kept)
        if not (isinstance(table, dict) and part not in table and table.get("kind") == part):
            kept = (*kept, part)
    return kept
