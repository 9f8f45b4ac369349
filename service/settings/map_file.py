"""Read a register map from a file of its own; a wrong one is refused with line, key and fix."""

import json
import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from service.settings.base import MisfitError
from service.settings.modbus_map import RegisterMapSettings
from service.settings.positions import Location, line_of

MAX_MAP_BYTES = 1_000_000


class MapFileError(Exception):
    """A register map that cannot be used; the message has one line for each mistake."""


def load_map_file(path: Path) -> RegisterMapSettings:
    """Read and check a register map.

    Raises
    ------
    MapFileError
        If it cannot be read or anything in it is wrong.
    """
    text = _read(path)
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise MapFileError(f"{path}: not TOML: {error}") from error
    try:
        return RegisterMapSettings.model_validate_json(json.dumps(data, default=str), strict=True)
    except ValidationError as error:
        raise MapFileError("\n".join(_line(path, text, e) for e in error.errors())) from error


def _read(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(MAX_MAP_BYTES + 1)
        if len(content) > MAX_MAP_BYTES:
            raise MapFileError(f"{path}: larger than {MAX_MAP_BYTES} bytes, no register map")
        return content.decode()
    except OSError as error:
        raise MapFileError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise MapFileError(f"{path}: not UTF-8 text at byte {error.start}") from error


def _line(path: Path, text: str, error: ErrorDetails) -> str:
    at: Location = tuple(part for part in error["loc"] if part not in ("epoch", "calendar"))
    reason: Any = error.get("ctx", {}).get("error")
    at += reason.at if isinstance(reason, MisfitError) else ()
    key = "".join(f"[{p + 1}]" if isinstance(p, int) else f".{p}" for p in at).lstrip(".")
    words = str(reason) if isinstance(reason, MisfitError) else error["msg"]
    value = error["input"]
    shown = f" = {value!r}" if isinstance(value, int | float | str | bool) else ""
    said = f"{key}{shown}: {words}".replace("\n", "\\n")  # a key may hold anything
    return f"{path}:{line_of(at, text)}: {said}"
