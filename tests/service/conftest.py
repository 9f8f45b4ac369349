"""What the service's tests share: plant files as text, and a way to change one line of them."""

from collections.abc import Callable
from pathlib import Path

import pytest

from service.settings.loading import PlantFileError, load_plant_file

DEPLOY = Path(__file__).parents[2] / "deploy"


@pytest.fixture
def deploy() -> Path:
    """Folder of the plant files that come with padwatch."""
    return DEPLOY


@pytest.fixture
def plant_text() -> str:
    """The demonstration plant: two units, each with channels, bearings and simulation."""
    return (DEPLOY / "demo.toml").read_text(encoding="utf-8")


@pytest.fixture
def changed(plant_text: str) -> Callable[[str, str], tuple[str, int]]:
    """Changes the first occurrence of a text in that file; also tells on which line that is."""

    def change(old: str, new: str) -> tuple[str, int]:
        before, found, after = plant_text.partition(old)
        assert found, f"the file has no {old!r}"
        return before + new + after, before.count("\n") + 1

    return change


@pytest.fixture
def mistakes(tmp_path: Path) -> Callable[[str | bytes], list[str]]:
    """Loads a plant file that must be refused; gives the message's lines after ``file:``."""

    def refused(text: str | bytes) -> list[str]:
        path = tmp_path / "plant.toml"
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        with pytest.raises(PlantFileError) as refusal:
            load_plant_file(path)
        lines = str(refusal.value).split("\n")
        assert all(line.startswith(f"{path}:") for line in lines)
        return [line.removeprefix(f"{path}:") for line in lines]

    return refused
