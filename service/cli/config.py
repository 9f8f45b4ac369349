"""`padwatch config`: check a plant file, print its schema or an example."""

import json

import typer

from acquisition.errors import ConfigError
from service.cli.options import (
    EXAMPLE,
    JsonOutput,
    PlantPath,
    command_group,
    example_path,
    fail,
    print_result,
)
from service.settings.can_values import require_dbc_fits
from service.settings.plant import load_plant_file, plant_file_schema

app = command_group("Check a plant file, print its schema or an example.")


@app.command()
def check(plant_file: PlantPath, json_output: JsonOutput = False) -> None:
    """Check a plant file and print each mistake with its line; exit code 2 if there are any."""
    plant = load_plant_file(plant_file)
    try:
        for unit in plant.unit:
            require_dbc_fits(unit)
    except ConfigError as error:
        fail(f"{plant_file}: {error}", code=2)
    n_bearings = sum(len(unit.bearing) for unit in plant.unit)
    n_channels = sum(len(unit.channel) for unit in plant.unit)
    counts = {"units": len(plant.unit), "bearings": n_bearings, "channels": n_channels}
    line = (
        f"{plant_file} is valid: {plant.plant.name}; units: {len(plant.unit)},"
        f" bearings: {n_bearings}, waveform channels: {n_channels}"
    )
    print_result({"plant": plant.plant.name, **counts}, [line], json_output, indent=None)


@app.command()
def schema() -> None:
    """Print the JSON schema of a plant file: meaning, limits and defaults of every key."""
    typer.echo(json.dumps(plant_file_schema(), indent=2, ensure_ascii=False))


@app.command()
def example() -> None:
    """Print a commented plant file to start from."""
    typer.echo(example_path(EXAMPLE).read_text(encoding="utf-8"), nl=False)
