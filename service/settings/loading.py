"""Loading and JSON schema of plant files."""

from pathlib import Path
from typing import Any

from service.settings.plant import PlantFile
from service.settings.toml_file import load_toml, schema_of


def plant_file_schema() -> dict[str, Any]:
    """Return the JSON schema of a plant file, with description, limits and default of every key."""
    return schema_of(PlantFile)


def load_plant_file(path: Path) -> PlantFile:
    """Read and validate a plant file.

    Raises `TomlFileError` if the file is unreadable or invalid; the message lists every mistake.
    """
    return load_toml(path, PlantFile)
