"""`padwatch run`: the service."""

import os
from typing import Annotated

import structlog
import typer

from acquisition.clock import SystemClock
from acquisition.errors import AcquisitionError
from service.api.http.listening import CertificateError, PortInUseError
from service.app.access import ClosedError
from service.app.program import Performance, run_service
from service.app.web import listener_of
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.measuring.sources import live_units
from service.runtime.ending import leave, run_to_its_end
from service.runtime.service_manager import ServiceManager
from service.settings.plant import PlantFile
from service.store.port import StoreError

log = structlog.get_logger()

CLOSED = (ClosedError, CertificateError)
"""What will be so the next time, too."""


def run(
    plant_file: PlantPath,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="HTTP port instead of the file's.")
    ] = None,
) -> None:
    """Acquire, analyse, store and serve a plant until Ctrl-C or SIGTERM."""
    plant = read_plant_file(plant_file)
    run_plant(plant, plant.service.port if port is None else port)
    leave()


def run_plant(plant: PlantFile, port: int, is_demo: bool = False) -> None:
    """Run the service on a port; ends the command with one line if it cannot.

    Parameters
    ----------
    is_demo
        Whether people and programs on this computer may do everything without a login.
    """
    try:
        with listener_of(plant, port) as listener:
            clock = SystemClock()
            performance = Performance(plant, live_units(plant, clock), is_demo=is_demo)
            manager = ServiceManager(os.environ)
            run_to_its_end(run_service(performance, listener, clock, announce, manager))
    except CLOSED as error:
        fail(f"padwatch: {error}", 2)
    except (PortInUseError, StoreError, AcquisitionError) as error:
        fail(f"padwatch: {error}")


def announce(url: str) -> None:
    """Tell where the dashboard is."""
    typer.echo(f"padwatch: {url}")
