"""`padwatch serve`: API and dashboard alone."""

import os
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from service.api.http.listening import PortInUseError
from service.app.serve_program import run_serve
from service.app.web import listener_of
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.cli.run import CLOSED, announce
from service.runtime.process import leave, run_to_its_end
from service.runtime.service_manager import ServiceManager
from service.store.port import StoreError

NEEDS_POSTGRESQL = (
    "padwatch serve shows what other processes write into PostgreSQL, and this plant file has no"
    " [store] with postgresql: give one, or use padwatch run"
)


def serve(
    plant_file: PlantPath,
    port: Annotated[
        int | None, typer.Option(min=0, max=65535, help="HTTP port instead of the file's.")
    ] = None,
) -> None:
    """Serve a plant that other processes acquire and analyse, until Ctrl-C or SIGTERM."""
    plant = read_plant_file(plant_file)
    if plant.store.postgresql is None:
        fail(f"padwatch: {NEEDS_POSTGRESQL}", 2)
    try:
        with listener_of(plant, plant.service.port if port is None else port) as listener:
            clock, manager = SystemClock(), ServiceManager(os.environ)
            run_to_its_end(run_serve(plant, listener, clock, announce, manager))
    except CLOSED as error:
        fail(f"padwatch: {error}", 2)
    except (PortInUseError, StoreError) as error:
        fail(f"padwatch: {error}")
    leave()
