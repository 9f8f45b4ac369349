"""Read a register map from a file of its own; a wrong one is refused with line, key and fix."""

from pathlib import Path

from service.settings.modbus_map import RegisterMapSettings
from service.settings.toml_file import load_toml

_KINDS_OF_TIME = ("epoch", "calendar")


def load_map_file(path: Path) -> RegisterMapSettings:
    """Read and check a register map.

    Raises
    ------
    TomlFileError
        If it cannot be read or anything in it is wrong.
    """
    return load_toml(path, RegisterMapSettings, _KINDS_OF_TIME)
