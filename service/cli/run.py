"""`padwatch run`, `serve`, `acquire`, `analyse` and `demo`."""

import os
from pathlib import Path
from typing import Annotated

import structlog
import typer

from acquisition.clock import SystemClock
from acquisition.errors import AcquisitionError
from service.api.http.listening import CertificateError, PortInUseError, listen
from service.app.health_page import HOST
from service.app.service import Performance, run_service
from service.app.serving_process import run_serve
from service.app.storage import open_store
from service.app.web import ClosedError, listener_of
from service.cli.daq import RunningDaq, daq_process
from service.cli.offline.demo_history import fill, without_past
from service.cli.options import (
    DEMO,
    DEMO_LIFE,
    PlantPath,
    example_path,
    fail,
    read_plant_file,
    stream_settings,
    terminal_to_itself,
)
from service.cluster.ownership import Partition
from service.cluster.session import StreamAnewError
from service.measuring.simulated_sources import simulated_history
from service.measuring.sources import live_units, monitor_of
from service.runtime.process import leave, run_to_its_end
from service.runtime.service_manager import ServiceManager
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.port import StoreError

log = structlog.get_logger()

CLOSED = (ClosedError, CertificateError)
"""Errors that a restart does not cure."""


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
    """Run the service on a port, or end the command with one line.

    Parameters
    ----------
    is_demo
        Whether local clients may do everything without a login.
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
    """Print the URL of the dashboard."""
    typer.echo(f"padwatch: {url}")


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
    from service.app.cluster_processes import run_acquire

    plant = read_plant_file(plant_file)
    settings = stream_settings(plant)
    wanted = _wanted(plant, unit or [])
    try:
        with listen(HOST, settings.acquire_port if port is None else port) as listener:
            clock, manager = SystemClock(), ServiceManager(os.environ)
            units = {id_: its for id_, its in live_units(plant, clock).items() if id_ in wanted}
            run_to_its_end(
                run_acquire(plant, settings, units, listener, clock, _announce_acquire, manager)
            )
    except (PortInUseError, AcquisitionError) as error:
        fail(f"padwatch: {error}")
    leave()


def _announce_acquire(url: str) -> None:
    """Print the URL of the health page."""
    typer.echo(f"padwatch acquire: {url}readyz")


def _wanted(plant: PlantFile, named: list[str]) -> set[str]:
    known = {unit.id for unit in plant.unit}
    for id_ in named:
        if id_ not in known:
            fail(f"padwatch: there is no unit {id_!r}; known are {', '.join(sorted(known))}", 2)
    return set(named) or known


def analyse(
    plant_file: PlantPath,
    partition: Annotated[
        str,
        typer.Option(help="Which units: i/n for the i-th of n shares, such as 1/2."),
    ] = "1/1",
    port: Annotated[
        int | None,
        typer.Option(min=0, max=65535, help="Port of the health page instead of the file's."),
    ] = None,
) -> None:
    """Analyse blocks from the stream and store results until Ctrl-C or SIGTERM.

    A second process for the same units stands by, and takes over when the first one ends.
    """
    from service.app.cluster_processes import run_analyse

    plant = read_plant_file(plant_file)
    settings = stream_settings(plant)
    part, mine = _part(plant, partition)
    monitors = {unit.id: monitor_of(unit, plant.analysis) for unit in mine.unit}
    try:
        with listen(HOST, settings.analyse_port if port is None else port) as listener:
            clock, manager = SystemClock(), ServiceManager(os.environ)
            run_to_its_end(
                run_analyse(
                    plant, part, settings, monitors, listener, clock, _announce_analyse, manager
                )
            )
    except* (PortInUseError, StoreError, StreamAnewError) as group:
        fail(f"padwatch: {_first(group)}")
    leave()


def _announce_analyse(url: str) -> None:
    """Print the URL of the health page."""
    typer.echo(f"padwatch analyse: {url}readyz")


def _part(plant: PlantFile, text: str) -> tuple[Partition, PlantFile]:
    try:
        partition = Partition.of(text)
        return partition, partition.part_of(plant)
    except ValueError as error:
        fail(f"padwatch: {error}", 2)


def _first(group: BaseExceptionGroup[BaseException]) -> BaseException:
    found = group.exceptions[0]
    return _first(found) if isinstance(found, BaseExceptionGroup) else found


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
    """Fill an empty store with a simulated year, or end the command with one line."""
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
