"""Reading a plant file: its JSON schema, and one sentence for each mistake."""

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from acquisition.delivery.small_file import read_small_file
from service.settings.base import MisfitError, MissingError, SecretMisfitError
from service.settings.plant import PlantFile
from service.settings.toml_file import Location, line_of
from service.settings.transducers import FOLDER


@cache
def plant_file_schema() -> dict[str, Any]:
    """JSON schema of a plant file, with meaning, limits and defaults of every key."""
    return PlantFile.model_json_schema()


def description(location: Sequence[int | str]) -> str:
    """Return the meaning of a key in one line; empty if the key is unknown."""
    node: dict[str, Any] = plant_file_schema()
    text = ""
    for part in location:
        step = _step(node, part)
        if step is None:
            return ""
        text = str(step.get("description", ""))
        node = step
    return " ".join(text.split())


def known_keys(location: Sequence[int | str]) -> list[str]:
    """Return the keys that a table of the plant file may have."""
    node: dict[str, Any] | None = plant_file_schema()
    for part in location:
        node = _step(node, part) if node is not None else None
    return sorted({key for option in _options(node or {}) for key in option.get("properties", {})})


def _step(node: dict[str, Any], part: int | str) -> dict[str, Any] | None:
    for option in _options(node):
        if isinstance(part, int) and "items" in option:
            items: dict[str, Any] = option["items"]
            return items
        if isinstance(part, str) and part in option.get("properties", {}):
            properties: dict[str, dict[str, Any]] = option["properties"]
            return properties[part]
    return None


def _options(node: dict[str, Any]) -> list[dict[str, Any]]:
    """Resolve references and alternatives to the schemas behind them."""
    if "$ref" in node:
        name = str(node["$ref"]).rsplit("/", 1)[-1]
        return _options(plant_file_schema()["$defs"][name])
    alternatives = [*node.get("anyOf", ()), *node.get("oneOf", ())]
    if alternatives:
        return [leaf for option in alternatives for leaf in _options(option)]
    return [node]


MAX_SHOWN = 60
"""Characters of a wrong value that are shown."""

UNION_ERRORS = ("union_tag_invalid", "union_tag_not_found")


def is_echo(error: ErrorDetails) -> bool:
    """Return whether a list is too short only because its elements are reported as wrong."""
    return error["type"] == "too_short" and len(error["input"]) >= error["ctx"]["min_length"]


def located(error: ErrorDetails, data: Mapping[str, Any]) -> Location:
    """Return the place of a mistake in the file."""
    location = _without_tags(error["loc"], data)
    reason = error.get("ctx", {}).get("error")
    if isinstance(reason, MisfitError):
        location += reason.at
    return (*location, "kind") if error["type"] in UNION_ERRORS else location


def sentence(error: ErrorDetails, location: Location, data: Mapping[str, Any]) -> str:
    """Return the message of a mistake."""
    key = "".join(_entry(part) for part in location).lstrip(".")
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


def _entry(part: int | str) -> str:
    """Format one step of a place on one line; a key may be any text."""
    if isinstance(part, int):
        return f"[{part + 1}]"
    return f".{part}" if part.isprintable() else f".{part!r}"


def _shown(value: Any) -> str:
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    text = value.isoformat() if isinstance(value, datetime) else text
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}…"


def _value(data: Any, location: Location) -> tuple[bool, Any]:
    """Return whether the file has a value at a place, and the value."""
    for part in location:
        inside = isinstance(data, dict) and part in data
        listed = isinstance(data, list) and isinstance(part, int) and part < len(data)
        if not inside and not listed:
            return False, None
        data = data[part]
    return True, data


def _without_tags(location: Location, data: Any) -> Location:
    """Remove the union tags that pydantic adds to the keys of the file."""
    kept: Location = ()
    for part in location:
        _, table = _value(data, kept)
        if not (isinstance(table, dict) and part not in table and table.get("kind") == part):
            kept = (*kept, part)
    return kept


MAX_FILE_BYTES = 4_000_000
"""Far above any plant file; limits memory when the path is wrong (a device, a recording)."""

TOO_DEEP = "nested too deeply for a plant file"

SYNTAX_PLACE = re.compile(r"^(.*) \(at line (\d+), (column \d+)\)$", re.DOTALL)


class PlantFileError(Exception):
    """A plant file that cannot be used; the message has one line for each mistake."""


def load_plant_file(path: Path) -> PlantFile:
    """Read and check a plant file.

    Raises
    ------
    PlantFileError
        If the file cannot be read or is wrong; the message names every mistake.
    """
    text = _read(path)
    data = _parsed(path, text)
    try:
        # only in JSON does strict mode (no text or boolean for a number) accept a list as a tuple
        return PlantFile.model_validate_json(
            json.dumps(data, default=str), strict=True, context={FOLDER: path.parent}
        )
    except RecursionError as error:  # from dotted keys, which TOML parses without recursion
        raise PlantFileError(f"{path}: {TOO_DEEP}") from error
    except ValidationError as error:
        if error.errors()[0]["type"] == "json_invalid":
            raise PlantFileError(f"{path}: {TOO_DEEP}") from error
        mistakes = [(located(e, data), e) for e in error.errors() if not is_echo(e)]
        lines = [f"{path}:{line_of(at, text)}: {sentence(e, at, data)}" for at, e in mistakes]
        raise PlantFileError("\n".join(lines)) from error


def _read(path: Path) -> str:
    try:
        content = read_small_file(path, MAX_FILE_BYTES)
        return content.decode()
    except OSError as error:
        raise PlantFileError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise PlantFileError(f"{path}:{line}: not UTF-8 text at byte {error.start}") from error


def _parsed(path: Path, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        place = SYNTAX_PLACE.match(str(error))
        last = text.count("\n") + 1
        line, words = (place[2], f"{place[1]} ({place[3]})") if place else (last, error)
        raise PlantFileError(f"{path}:{line}: not TOML: {words}") from error
    except ValueError as error:
        raise PlantFileError(f"{path}: an integer of thousands of digits") from error
    except RecursionError as error:
        raise PlantFileError(f"{path}: {TOO_DEEP}") from error
