"""Read one settings model from a TOML file; a wrong file is refused with line, key and fix."""

import json
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from acquisition.delivery.small_file import read_small_file
from service.settings.base import MisfitError, Settings
from service.settings.positions import Location, line_of

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
        What pydantic puts into a place for the kinds of a union, and the file does not have.

    Raises
    ------
    TomlFileError
        If it cannot be read or anything in it is wrong.
    """
    text = _read(path)
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise TomlFileError(f"{path}: not TOML: {error}") from error
    try:
        # JSON, because only there strict (no text for a number) lets a list be a tuple
        return model.model_validate_json(json.dumps(data, default=str), strict=True)
    except RecursionError as error:  # of dotted keys, which TOML reads without going deep
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
    said = f"{key}{shown}: {words}".replace("\n", "\\n")  # a key may hold anything
    return f"{path}:{line_of(at, text)}: {said}"
