"""Read a plant file; a wrong one is refused with file, line, key, value and what is allowed."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from acquisition.delivery.small_file import read_small_file
from service.settings.mistakes import is_echo, located, sentence
from service.settings.plant import PlantFile
from service.settings.positions import line_of
from service.settings.response import FOLDER

MAX_FILE_BYTES = 4_000_000
"""Far above any plant; keeps a wrong path (a device, a recording) from filling the memory."""

TOO_DEEP = "nested too deeply for a plant file"

SYNTAX_PLACE = re.compile(r"^(.*) \(at line (\d+), (column \d+)\)$", re.DOTALL)


class PlantFileError(Exception):
    """A plant file that cannot be used; the message has one line for each mistake."""


def load_plant_file(path: Path) -> PlantFile:
    """Read and check a plant file.

    Raises
    ------
    PlantFileError
        If it cannot be read or anything in it is wrong; every mistake is named, not only the first.
    """
    text = _read(path)
    data = _parsed(path, text)
    try:
        # JSON, because only there strict (no text or truth for a number) lets a list be a tuple
        return PlantFile.model_validate_json(
            json.dumps(data, default=str), strict=True, context={FOLDER: path.parent}
        )
    except RecursionError as error:  # of dotted keys, which TOML reads without going deep
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
