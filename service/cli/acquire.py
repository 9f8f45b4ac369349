"""`padwatch acquire`: devices in, blocks on a stream out."""

import os
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from acquisition.errors import AcquisitionError
from service.api.http.listening import PortInUseError, listen
from service.app.health.serving import HOST
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.cli.stream import stream_settings
from service.measuring.sources import live_units
from service.runtime.process import leave, run_to_its_end
from service.runtime.service_manager import ServiceManager
from service.settings.plant import PlantFile


def acquire(
    plant_file: PlantPath,
    unit: Annotated[
        list[str] | None,
        typer.Option(help="Read this unit only; may be given again. Without it, all units."),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(min=0, max=65535, help="Port of the health page instead of the file's."),
    ] = None,
) -> None:
    """Read devices and publish their blocks to the stream until Ctrl-C or SIGTERM."""
    from service.app.acquire_program import run_acquire

    plant = read_plant_file(plant_file)
    settings = stream_settings(plant)
    wanted = _wanted(plant, unit or [])
    try:
        with listen(HOST, settings.acquire_port if port is None else port) as listener:
            clock, manager = SystemClock(), ServiceManager(os.environ)
            units = {id_: its for id_, its in live_units(plant, clock).items() if id_ in wanted}
            run_to_its_end(run_acquire(plant, settings, units, listener, clock, announce, manager))
    except (PortInUseError, AcquisitionError) as error:
        fail(f"padwatch: {error}")
    leave()


def announce(url: str) -> None:
    """Tell where the health page is."""
    typer.echo(f"padwatch acquire: {url}readyz")


def _wanted(plant: PlantFile, named: list[str]) -> set[str]:
    known = {unit.id for unit in plant.unit}
    for id_ in named:
        if id_ not in known:
            fail(f"padwatch: there is no unit {id_!r}; known are {', '.join(sorted(known))}", 2)
    return set(named) or known
