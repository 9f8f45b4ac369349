"""A plant file for commands."""

from pathlib import Path

import pytest


@pytest.fixture
def plant_path(plant_text: str, tmp_path: Path) -> Path:
    """The demonstration plant, with its data in a folder that is not there yet."""
    path, folder = tmp_path / "plant.toml", tmp_path / "data"
    old = 'data_folder = "var/demo"'
    assert old in plant_text
    path.write_text(plant_text.replace(old, f'data_folder = "{folder}"'), encoding="utf-8")
    return path
