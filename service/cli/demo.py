"""`padwatch demo`: a simulated plant, its DAQ and the service, in one command."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from service.cli.examples import DEMO, example_path
from service.cli.plant_file import fail, read_plant_file
from service.cli.run import run_plant
from service.cli.terminal import terminal_to_itself
from service.settings.plant import PlantFile
from service.settings.sources import ModbusRingSettings

STOP_S = 3.0


def demo(
    port: Annotated[int, typer.Option(min=0, max=65535, help="HTTP port.")] = 8080,
    data_folder: Annotated[
        Path | None, typer.Option(help="Folder of the database instead of ./var/demo.")
    ] = None,
) -> None:
    """Show padwatch at work on two simulated 700 MW units behind a real Modbus TCP DAQ."""
    path = example_path(DEMO)
    plant = read_plant_file(path)
    if data_folder is not None:
        service = plant.service.model_copy(update={"data_folder": str(data_folder)})
        plant = plant.model_copy(update={"service": service})
    with terminal_to_itself(), _daq(path) as ports:
        typer.echo("padwatch: simulated DAQs on loopback, ports " + _listed(ports))
        run_plant(_with_ports(plant, ports), port)


@contextmanager
def _daq(plant_file: Path) -> Iterator[dict[str, int]]:
    """Run the DAQ as a process of its own; it ends with this one, however that ends."""
    command = [sys.executable, "-m", "service.cli.main", "daq", str(plant_file)]
    process = subprocess.Popen(  # noqa: S603  our own program
        [*command, "--until-input-ends"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,  # Ctrl-C is for this process, which stops the DAQ last
    )
    try:
        line = process.stdout.readline() if process.stdout else b""
        if not line:
            fail("padwatch: the simulated DAQ did not start; its own message stands above")
        yield json.loads(line)
    finally:
        process.terminate()
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _with_ports(plant: PlantFile, ports: dict[str, int]) -> PlantFile:
    units = []
    for unit in plant.unit:
        source = unit.source
        if isinstance(source, ModbusRingSettings):
            source = source.model_copy(update={"port": ports[unit.id]})
        units.append(unit.model_copy(update={"source": source}))
    return plant.model_copy(update={"unit": tuple(units)})


def _listed(ports: dict[str, int]) -> str:
    return ", ".join(f"{port} ({unit})" for unit, port in ports.items())
