"""The command line in the test's own process and as a program, and a plant file for it."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from typer.testing import CliRunner, Result

from service.cli.commands import app

ROOT = Path(__file__).parents[3]


class Ended(NamedTuple):
    """A program that has ended; fields as in `Result`."""

    exit_code: int
    stdout: str
    stderr: str


@pytest.fixture
def padwatch() -> Callable[..., Result]:
    """Runs a command in this process."""
    return lambda *arguments: CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture
def padwatch_program() -> Callable[..., Ended]:
    """Runs a command as a program of its own, which takes two seconds of processor time."""

    def run(*arguments: object) -> Ended:
        done = subprocess.run(
            [sys.executable, "-m", "service.cli.main", *map(str, arguments)],
            capture_output=True,
            text=True,
            env={"PYTHONPATH": str(ROOT), "PATH": ""},
            check=False,
        )
        return Ended(done.returncode, done.stdout, done.stderr)

    return run


@pytest.fixture
def plant_path(plant_text: str, tmp_path: Path) -> Path:
    """The demonstration plant, with its data in a folder that is not there yet."""
    path, folder = tmp_path / "plant.toml", tmp_path / "data"
    old = 'data_folder = "var/demo"'
    assert old in plant_text
    path.write_text(plant_text.replace(old, f'data_folder = "{folder}"'), encoding="utf-8")
    return path
