"""The plant file argument of a command, and how mistakes reach the user."""

from pathlib import Path
from typing import Annotated, NoReturn

import typer

from service.settings.loading import PlantFileError, load_plant_file
from service.settings.plant import PlantFile

PlantPath = Annotated[Path, typer.Argument(help="The plant file (TOML).", show_default=False)]


def read_plant_file(path: Path) -> PlantFile:
    """Read a plant file, or end with exit code 2 and a line for each mistake."""
    try:
        return load_plant_file(path)
    except PlantFileError as error:
        fail(str(error), code=2)


def fail(message: str, code: int = 1) -> NoReturn:
    """End the command with a message for people."""
    typer.echo(message, err=True)
    raise typer.Exit(code)
