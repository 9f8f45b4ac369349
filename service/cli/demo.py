"""`padwatch demo`: a simulated plant, its DAQ and the service, in one command."""

from pathlib import Path
from typing import Annotated

import typer

from service.cli.daq_process import RunningDaq, daq_process
from service.cli.examples import DEMO, example_path
from service.cli.plant_file import read_plant_file
from service.cli.run import run_plant
from service.cli.terminal import terminal_to_itself


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
    with terminal_to_itself(), daq_process([str(path)]) as running:
        typer.echo("padwatch: simulated DAQs on loopback, ports " + _listed(running))
        run_plant(running.attached(plant), port)


def _listed(daq: RunningDaq) -> str:
    return ", ".join(f"{found['port']} ({unit})" for unit, found in daq.endpoints.items())
