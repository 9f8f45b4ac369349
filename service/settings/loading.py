"""Reading of plant files, and their JSON schema."""

from pathlib import Path
from typing import Any

from service.settings.plant import PlantFile
from service.settings.toml_file import load_toml, schema_of


def plant_file_schema() -> dict[str, Any]:
    """Return the JSON schema of a plant file, with meaning, limits and defaults of every key."""
    return schema_of(PlantFile)


def load_plant_file(path: Path) -> PlantFile:
    """Read and validate a plant file.

    Raises `TomlFileError` if the file cannot be read or is wrong; the message names every mistake.
    """
    return load_toml(path, PlantFile)
