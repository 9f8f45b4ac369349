"""`padwatch demo`: a simulated plant, its DAQ and the service, in one command."""

from pathlib import Path
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from acquisition.errors import AcquisitionError
from service.app.stores import open_store
from service.cli.daq_process import RunningDaq, daq_process
from service.cli.examples import DEMO, DEMO_LIFE, example_path
from service.cli.offline.demo.past import fill, without_past
from service.cli.plant_file import fail, read_plant_file
from service.cli.run import run_plant
from service.cli.terminal import terminal_to_itself
from service.measuring.simulated_sources import simulated_history
from service.settings.origin import Origin
from service.settings.plant import PlantFile
from service.store.port import StoreError


def demo(
    port: Annotated[int, typer.Option(min=0, max=65535, help="HTTP port.")] = 8080,
    data_folder: Annotated[
        Path | None, typer.Option(help="Folder of the database instead of ./var/demo.")
    ] = None,
    plain: Annotated[
        bool, typer.Option("--plain", help="Without a simulated past, and nothing goes wrong.")
    ] = False,
) -> None:
    """Show padwatch at work on two simulated 700 MW units behind a real Modbus TCP DAQ."""
    path = example_path(DEMO if plain else DEMO_LIFE)
    plant = read_plant_file(path)
    if data_folder is not None:
        service = plant.service.model_copy(update={"data_folder": str(data_folder)})
        plant = plant.model_copy(update={"service": service})
    with terminal_to_itself():
        if not plain:
            _give_past(plant)
        with daq_process([str(path)]) as running:
            typer.echo("padwatch: simulated DAQs on loopback, ports " + _listed(running))
            run_plant(running.attached(plant), port, is_demo=True)


def _give_past(plant: PlantFile) -> None:
    """Fill an empty store with a simulated year; ends the command with one line if it cannot."""
    now_ns = SystemClock().now_ns()
    try:
        store = open_store(plant, Origin.LIVE)
        try:
            new = without_past(store.films, plant)
            if new:
                typer.echo("padwatch: simulating the year before this start …")
                lives = {unit.id: simulated_history(unit, now_ns) for unit in new}
                fill(store.films, plant, lives, now_ns)
        finally:
            store.close()
    except (StoreError, AcquisitionError) as error:
        fail(f"padwatch: {error}")


def _listed(daq: RunningDaq) -> str:
    return ", ".join(f"{found['port']} ({unit})" for unit, found in daq.endpoints.items())
