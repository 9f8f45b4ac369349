"""TOML files: parsing, validation, and an error message with a line number for each mistake."""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from datetime import datetime
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from acquisition.delivery.small_file import read_small_file
from service.settings.base import MisfitError, MissingError, SecretMisfitError, Settings

Location: TypeAlias = tuple[int | str, ...]
"""Path to a value in a TOML file: nested keys; the key of an array is followed by an index."""

HEADER = re.compile(r"^\s*(\[\[?)\s*([A-Za-z0-9_.\"-]+?)\s*\]\]?\s*(?:#.*)?$")
KEY = re.compile(r"^\s*([A-Za-z0-9_.-]+)\s*=")


def _line_of(location: Location, text: str) -> int:
    """Return the line number of a key, or of the innermost table around the key; else 1."""
    lines = dict(_lines(text))
    starts = (location[:n] for n in range(len(location), 0, -1))
    return next((lines[start] for start in starts if start in lines), 1)


def _lines(text: str) -> Iterator[tuple[Location, int]]:
    """Yield location and line number of each table header, and of each key that begins a line."""
    table: Location = ()
    counts: dict[Location, int] = {}
    for number, line in enumerate(text.split("\n"), start=1):
        if header := HEADER.match(line):
            table = _table_location(header[2].split("."), header[1] == "[[", counts)
            yield table, number
            if table[-1] == 0:
                yield table[:-1], number
        elif key := KEY.match(line):
            yield (*table, *key[1].split(".")), number


def _table_location(names: list[str], is_array: bool, counts: dict[Location, int]) -> Location:
    """Return the location of a table; the key of an array of tables is followed by an index."""
    location: Location = ()
    for position, name in enumerate(names):
        location = (*location, name.strip('"'))
        if is_array and position == len(names) - 1:
            counts[location] = counts.get(location, -1) + 1
        if location in counts:
            location = (*location, counts[location])
    return location


Schema: TypeAlias = dict[str, Any]
"""JSON schema, or a subschema."""


@cache
def schema_of(model: type[Settings]) -> Schema:
    """Return the JSON schema of a model, with description, limits and default of every key."""
    return model.model_json_schema()


def description(schema: Schema, location: Location) -> str:
    """Return the description of a key in one line; an empty string if the key is unknown."""
    return " ".join(str(_node(schema, location).get("description", "")).split())


def _known_keys(schema: Schema, location: Location) -> list[str]:
    """Return the valid keys of a table, sorted; empty if the table is unknown."""
    options = _options(schema, _node(schema, location))
    return sorted({key for option in options for key in option.get("properties", {})})


def _node(schema: Schema, location: Location) -> Schema:
    """Return the subschema of a value; an empty one if the value is unknown."""
    node = schema
    for part in location:
        options = _options(schema, node)
        steps = [
            o.get("items") if isinstance(part, int) else o.get("properties", {}).get(part)
            for o in options
        ]
        node = next((step for step in steps if step is not None), {})
    return node


def _options(schema: Schema, node: Schema) -> list[Schema]:
    """Return the alternative schemas of a node, with references resolved."""
    if "$ref" in node:
        name = str(node["$ref"]).rsplit("/", 1)[-1]
        return _options(schema, schema["$defs"][name])
    alternatives = [*node.get("anyOf", ()), *node.get("oneOf", ())]
    if alternatives:
        return [leaf for option in alternatives for leaf in _options(schema, option)]
    return [node]


MAX_SHOWN = 60
"""Maximum number of characters of a wrong value in an error message."""

UNION_ERRORS = ("union_tag_invalid", "union_tag_not_found")


def located(error: ErrorDetails, data: Mapping[str, Any]) -> Location:
    """Return the location of a validation error in ``data``, the content of the file."""
    location = _without_tags(error["loc"], data)
    reason = error.get("ctx", {}).get("error")
    if isinstance(reason, MisfitError):
        location += reason.at
    return (*location, "kind") if error["type"] in UNION_ERRORS else location


def sentence(
    schema: Schema, error: ErrorDetails, location: Location, data: Mapping[str, Any]
) -> str:
    """Return the message of a validation error: key, value, problem and description of the key."""
    key = "".join(_entry(part) for part in location).lstrip(".")
    found, value = _value(data, location)
    holds_tables = isinstance(value, list) and any(isinstance(each, dict) for each in value)
    shown = key if holds_tables else f"{key} = {_shown(value)}"
    meaning = description(schema, location)
    if error["type"] == "extra_forbidden":
        known = _known_keys(schema, location[:-1])
        similar = get_close_matches(str(location[-1]), known, n=1)
        hint = f" (did you mean {similar[0]}?)" if similar else ""
        return f"{shown}: unknown key{hint}; known keys: {', '.join(known)}"
    is_missing = isinstance(error.get("ctx", {}).get("error"), MissingError)
    if error["type"] == "value_error" and not is_missing:
        if isinstance(error["ctx"]["error"], SecretMisfitError):
            return f"{key}: {error['ctx']['error']}"
        return f"{shown if found else f'{key} (by default)'}: {error['ctx']['error']}"
    if is_missing:
        problem = f"{key} {error['ctx']['error']}"
    elif not found:
        problem = f"{key} is missing"
    elif error["type"] == "union_tag_invalid":
        problem = f"{shown}: must be {error['ctx']['expected_tags'].replace(', ', ' or ')}"
    else:
        problem = f"{shown}: {error['msg']}"
    return f"{problem} — {meaning}" if meaning else problem


def _entry(part: int | str) -> str:
    """Format a key or an index of a location; a key with unprintable characters is escaped."""
    if isinstance(part, int):
        return f"[{part + 1}]"
    return f".{part}" if part.isprintable() else f".{part!r}"


def _shown(value: Any) -> str:
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    text = value.isoformat() if isinstance(value, datetime) else text
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}…"


def _value(data: Any, location: Location) -> tuple[bool, Any]:
    """Return whether the file has a value at a location, and the value (None without one)."""
    for part in location:
        inside = isinstance(data, dict) and part in data
        listed = isinstance(data, list) and isinstance(part, int) and part < len(data)
        if not inside and not listed:
            return False, None
        data = data[part]
    return True, data


def _without_tags(location: Location, data: Any) -> Location:
    """Return a location without the union tags that pydantic inserts between the keys."""
    kept: Location = ()
    for part in location:
        _, table = _value(data, kept)
        if not (isinstance(table, dict) and part not in table and table.get("kind") == part):
            kept = (*kept, part)
    return kept


MAX_FILE_BYTES = 4_000_000
"""Maximum size of a file, bytes; limits the memory if the path is that of a recording."""

FOLDER = "folder"
"""Key of the validation context of pydantic for the file's folder, the base of relative paths."""

TOO_DEEP = "tables or arrays are nested too deeply"

SYNTAX_PLACE = re.compile(r"^(.*) \(at line (\d+), (column \d+)\)$", re.DOTALL)

Model = TypeVar("Model", bound=Settings)


class TomlFileError(Exception):
    """Error raised if a TOML file is unreadable or invalid, with one line for each mistake."""


def load_toml(path: Path, model: type[Model]) -> Model:
    """Read and validate a TOML file.

    Raises `TomlFileError` if the file is unreadable or invalid; the message lists every mistake.
    """
    text = read_text(path, MAX_FILE_BYTES, TomlFileError)
    data = _parsed(path, text)
    try:
        # strict mode (no text or boolean for a number) accepts a list as a tuple only in JSON
        return model.model_validate_json(
            json.dumps(data, default=str), strict=True, context={FOLDER: path.parent}
        )
    except RecursionError as error:  # by dotted keys: the TOML parser does not recurse
        raise TomlFileError(f"{path}: {TOO_DEEP}") from error
    except ValidationError as error:
        if error.errors()[0]["type"] == "json_invalid":
            raise TomlFileError(f"{path}: {TOO_DEEP}") from error
        schema = schema_of(model)
        mistakes = [
            (located(e, data), e)
            for e in error.errors()
            # pydantic removes invalid elements, and then also reports that the list is too short
            if e["type"] != "too_short" or len(e["input"]) < e["ctx"]["min_length"]
        ]
        lines = (
            f"{path}:{_line_of(at, text)}: {sentence(schema, e, at, data)}" for at, e in mistakes
        )
        raise TomlFileError("\n".join(lines)) from error


def read_text(path: Path, max_bytes: int, fault: type[Exception], encoding: str = "utf-8") -> str:
    """Return the text of a file; raise ``fault`` if unreadable, too large, or not UTF-8."""
    try:
        content = read_small_file(path, max_bytes)
        return content.decode(encoding)
    except OSError as error:
        raise fault(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        words = f"byte {error.start} is not valid UTF-8; save the file as UTF-8"
        raise fault(f"{path}:{line}: {words}") from error


UNQUOTED = re.compile(r"\s*[\w.-]+\s*=\s*[^\W\d]")
"""A key with a value that begins with a letter."""


def _parsed(path: Path, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        place = SYNTAX_PLACE.match(str(error))
        last = text.count("\n") + 1
        line, words = (place[2], f"{place[1]} ({place[3]})") if place else (last, error)
        wrong = text.splitlines()[int(line) - 1 :][:1]
        hint = "; text needs quotes" if wrong and UNQUOTED.match(wrong[0]) else ""
        raise TomlFileError(f"{path}:{line}: invalid TOML: {words}{hint}") from error
    except ValueError as error:
        raise TomlFileError(f"{path}: an integer has too many digits") from error
    except RecursionError as error:
        raise TomlFileError(f"{path}: {TOO_DEEP}") from error
