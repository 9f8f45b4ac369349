"""TOML files: parsing, and the line of each key."""

import json
import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from acquisition.delivery.small_file import read_small_file
from service.settings.base import MisfitError, Settings

Location: TypeAlias = tuple[int | str, ...]
"""Keys, and after each array the number of the element."""

HEADER = re.compile(r"^\s*(\[\[?)\s*([A-Za-z0-9_.\"-]+?)\s*\]\]?\s*(?:#.*)?$")
KEY = re.compile(r"^\s*([A-Za-z0-9_.-]+)\s*=")


def line_of(location: Location, text: str) -> int:
    """Return the line of a key, or of the innermost table around it with its own line."""
    lines = dict(_lines(text))
    starts = (location[:n] for n in range(len(location), 0, -1))
    return next((lines[start] for start in starts if start in lines), 1)


def _lines(text: str) -> Iterator[tuple[Location, int]]:
    """Yield the line numbers of the tables and keys at the start of a line."""
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
    """Return the location of a header: names, and the element number after array tables."""
    location: Location = ()
    for position, name in enumerate(names):
        location = (*location, name.strip('"'))
        if is_array and position == len(names) - 1:
            counts[location] = counts.get(location, -1) + 1
        if location in counts:
            location = (*location, counts[location])
    return location


MAX_BYTES = 1_000_000
_MAX_SHOWN = 60

Model = TypeVar("Model", bound=Settings)


class TomlFileError(Exception):
    """A file that cannot be used; the message has one line for each mistake."""


def load_toml(path: Path, model: type[Model], tags: Sequence[str] = ()) -> Model:
    """Read and check a file.

    Parameters
    ----------
    tags
        Union tags that pydantic adds to a location and the file does not have.

    Raises
    ------
    TomlFileError
        If the file cannot be read or is wrong.
    """
    text = _read(path)
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise TomlFileError(f"{path}: not TOML: {error}") from error
    try:
        # only in JSON does strict mode (no text for a number) accept a list as a tuple
        return model.model_validate_json(json.dumps(data, default=str), strict=True)
    except RecursionError as error:  # from dotted keys, which TOML parses without recursion
        raise TomlFileError(f"{path}: nested too deeply") from error
    except ValidationError as error:
        mistakes = error.errors(include_url=False)
        raise TomlFileError("\n".join(_line(path, text, e, tags) for e in mistakes)) from error


def _read(path: Path) -> str:
    try:
        content = read_small_file(path, MAX_BYTES)
    except OSError as error:
        raise TomlFileError(f"{path}: {error.strerror}") from error
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        raise TomlFileError(f"{path}: not UTF-8 text at byte {error.start}") from error


def _line(path: Path, text: str, error: ErrorDetails, tags: Sequence[str]) -> str:
    at: Location = tuple(part for part in error["loc"] if part not in tags)
    reason: Any = error.get("ctx", {}).get("error")
    at += reason.at if isinstance(reason, MisfitError) else ()
    key = "".join(f"[{p + 1}]" if isinstance(p, int) else f".{p}" for p in at).lstrip(".")
    words = str(reason) if isinstance(reason, MisfitError) else error["msg"]
    value = error["input"]
    for part in reason.at if isinstance(reason, MisfitError) else ():
        value = value.get(part) if isinstance(value, dict) else None
    shown = f" = {value!r}"[:_MAX_SHOWN] if isinstance(value, int | float | str) else ""
    said = f"{key}{shown}: {words}".replace("\n", "\\n")  # a key may contain line breaks
    return f"{path}:{line_of(at, text)}: {said}"
