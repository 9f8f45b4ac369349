"""Read a plant file; a wrong one is refused with file, line, key, value and what is allowed."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from service.settings.plant import PlantFile
from service.settings.schema import description, known_keys

Location: TypeAlias = tuple[int | str, ...]

MAX_FILE_BYTES = 4_000_000
"""Far above any plant; keeps a wrong path (a device, a recording) from filling the memory."""

HEADER = re.compile(r"^\s*(\[\[?)\s*([A-Za-z0-9_.\"-]+?)\s*\]\]?\s*(?:#.*)?$")
KEY = re.compile(r"^\s*([A-Za-z0-9_-]+)\s*=")


class PlantFileError(Exception):
    """A plant file that cannot be used; the message has one line for each mistake."""


def load_plant_file(path: Path) -> PlantFile:
    """Read and check a plant file.

    Raises
    ------
    PlantFileError
        If it cannot be read or anything in it is wrong; every mistake is named, not only the first.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MAX_FILE_BYTES + 1)
        if len(content) > MAX_FILE_BYTES:
            raise PlantFileError(f"{path}: larger than {MAX_FILE_BYTES} bytes, not a plant file")
        text = content.decode()
        data = tomllib.loads(text)
    except OSError as error:
        raise PlantFileError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise PlantFileError(f"{path}: not UTF-8 text at byte {error.start}") from error
    except tomllib.TOMLDecodeError as error:
        raise PlantFileError(f"{path}: {error}") from error
    try:
        return PlantFile.model_validate(data)
    except ValidationError as error:
        lines = dict(_lines(text))
        mistakes = [_mistake(path, e, data, lines) for e in error.errors(include_url=False)]
        raise PlantFileError("\n".join(mistakes)) from error


def _mistake(
    path: Path, error: ErrorDetails, data: Mapping[str, Any], lines: Mapping[Location, int]
) -> str:
    location = _without_tags(error["loc"], data)
    where = next(
        (lines[location[:n]] for n in range(len(location), 0, -1) if location[:n] in lines), 1
    )
    key = "".join(f"[{p + 1}]" if isinstance(p, int) else f".{p}" for p in location).lstrip(".")
    if error["type"] == "missing":
        problem = f"{key} is missing"
    elif error["type"] == "extra_forbidden":
        known = ", ".join(known_keys(location[:-1]))
        return f"{path}:{where}: {key} = {error['input']!r}: unknown key; known here: {known}"
    elif error["type"] == "value_error":
        problem = f"{key}: {error['msg'].removeprefix('Value error, ')}".lstrip(": ")
        return f"{path}:{where}: {problem}"
    else:
        problem = f"{key} = {error['input']!r}: {error['msg']}"
    meaning = description(location)
    return f"{path}:{where}: {problem}" + (f" — {meaning}" if meaning else "")


def _without_tags(location: Location, data: Any) -> Location:
    """Drop what pydantic puts into a location beside the file's own keys: union tags."""
    kept: list[int | str] = []
    for part in location:
        if isinstance(data, dict) and part not in data and data.get("kind") == part:
            continue
        kept.append(part)
        inside = isinstance(data, dict) and part in data
        listed = isinstance(data, list) and isinstance(part, int) and part < len(data)
        data = data[part] if inside or listed else None
    return tuple(kept)


def _lines(text: str) -> Iterator[tuple[Location, int]]:
    """Line numbers of tables and keys, as far as they stand at the start of a line."""
    table: Location = ()
    counts: dict[Location, int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if header := HEADER.match(line):
            table = _table_location(header[2].split("."), header[1] == "[[", counts)
            yield table, number
        elif key := KEY.match(line):
            yield (*table, key[1]), number


def _table_location(names: list[str], is_array: bool, counts: dict[Location, int]) -> Location:
    """Where a header leads: names, and after each array of tables the number of its element."""
    location: Location = ()
    for position, name in enumerate(names):
        location = (*location, name.strip('"'))
        if is_array and position == len(names) - 1:
            counts[location] = counts.get(location, -1) + 1
        if location in counts:
            location = (*location, counts[location])
    return location
