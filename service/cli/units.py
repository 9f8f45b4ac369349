"""The `--unit` option: which unit of a plant a command is about."""

from pathlib import Path
from typing import Annotated

import typer

from service.cli.plant_file import fail
from service.settings.plant import PlantFile
from service.settings.units import UnitSettings

UnitOption = Annotated[
    str | None, typer.Option("--unit", help="Unit of the plant file.", show_default=False)
]


def one_unit(plant: PlantFile, id_: str | None, path: Path) -> UnitSettings:
    """Find a unit, or end with exit code 2; a plant's only unit need not be named."""
    known = ", ".join(unit.id for unit in plant.unit)
    if id_ is None and len(plant.unit) > 1:
        fail(f"{path}: has units {known}; choose one with --unit", code=2)
    chosen = [unit for unit in plant.unit if id_ in (unit.id, None)]
    if not chosen:
        fail(f"{path}: has no unit {id_}, it has {known}", code=2)
    return chosen[0]
