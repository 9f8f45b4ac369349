"""`padwatch serve`, `acquire`, `analyse` and `demo`."""

import os
from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path
from socket import socket
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from service.app.health_page import HOST
from service.app.listener import listener_of
from service.app.measuring_process import run_service
from service.app.process import Host
from service.app.storage import open_store
from service.cli.options import (
    DEMO,
    DEMO_LIFE,
    PlantPath,
    PortOption,
    example_path,
    fail,
    terminal_to_itself,
)
from service.measuring.sources import live_units
from service.runtime.child import Child
from service.runtime.listening import PortInUseError, listen
from service.runtime.process import leave, run_to_its_end
from service.runtime.service_manager import ServiceManager
from service.settings.plant import PlantFile, load_plant_file
from service.settings.processes import StreamSettings
from service.store.port import StoreError

HealthPort = Annotated[
    int | None,
    typer.Option("--port", min=0, max=65535, help="Port of the health page instead of the file's."),
]


def run_plant(
    plant: PlantFile, listener: socket, is_demo: bool = False, child: Child | None = None
) -> None:
    """Run the service of a plant on a listening socket, and block until Ctrl-C or SIGTERM.

    Parameters
    ----------
    is_demo
        Whether local clients have all permissions without a login.
    child
        Serving process that was started before; with None one is started.
    """
    host = Host(listener, SystemClock(), announce, ServiceManager(os.environ))
    units = live_units(plant, host.clock)
    run_to_its_end(run_service(plant, units, host, is_demo=is_demo, child=child))


def announce(url: str) -> None:
    """Print the URL of the dashboard to standard output."""
    typer.echo(f"padwatch: {url}")


NEEDS_POSTGRESQL = (
    "padwatch serve shows what other processes write into PostgreSQL, and this plant file has no"
    " [store] with postgresql: add one, or use padwatch run"
)


def serve(plant_file: PlantPath, port: PortOption = None) -> None:
    """Serve a plant that other processes acquire and analyse, until Ctrl-C or SIGTERM."""
    from service.app.replica_process import run_serve

    plant = load_plant_file(plant_file)
    if plant.store.postgresql is None:
        fail(NEEDS_POSTGRESQL, 2)
    with listener_of(plant, plant.service.port if port is None else port) as listener:
        host = Host(listener, SystemClock(), announce, ServiceManager(os.environ))
        run_to_its_end(run_serve(plant, host))
    leave()


def acquire(
    plant_file: PlantPath,
    unit: Annotated[
        list[str] | None,
        typer.Option(help="Unit to read; may be repeated. All units by default."),
    ] = None,
    port: HealthPort = None,
) -> None:
    """Read devices and publish their blocks to the stream until Ctrl-C or SIGTERM."""
    from service.app.cluster_processes import run_acquire

    plant = load_plant_file(plant_file)
    settings, known = _stream_settings(plant), {each.id for each in plant.unit}
    for id_ in unit or ():
        if id_ not in known:
            fail(f"unknown unit {id_!r}; known units: {', '.join(sorted(known))}", 2)
    wanted = set(unit or known)
    with listen(HOST, settings.acquire_port if port is None else port) as listener:
        host = Host(listener, SystemClock(), _announcer("acquire"), ServiceManager(os.environ))
        units = {id_: its for id_, its in live_units(plant, host.clock).items() if id_ in wanted}
        run_to_its_end(run_acquire(plant, settings, units, host))
    leave()


def analyse(
    plant_file: PlantPath,
    partition: Annotated[
        str, typer.Option(help="Share of the units: i/n for the i-th of n shares, such as 1/2.")
    ] = "1/1",
    port: HealthPort = None,
) -> None:
    """Analyse blocks from the stream and store results until Ctrl-C or SIGTERM.

    A second process for the same units stands by, and takes over when the first one ends.
    """
    from service.app.cluster_processes import run_analyse
    from service.cluster.ownership import Partition
    from service.cluster.session import StreamAnewError

    plant = load_plant_file(plant_file)
    settings = _stream_settings(plant)
    try:
        part = Partition.of(partition)
        part.part_of(plant)  # refuses an empty part
    except ValueError as error:
        fail(str(error), 2)
    with listen(HOST, settings.analyse_port if port is None else port) as listener:
        host = Host(listener, SystemClock(), _announcer("analyse"), ServiceManager(os.environ))
        try:
            run_to_its_end(run_analyse(plant, part, settings, host))
        except ExceptionGroup as group:
            _, others = group.split((StoreError, StreamAnewError))
            if others is not None:
                raise
            raise _first(group) from None
    leave()


def _first(error: Exception) -> Exception:
    return _first(error.exceptions[0]) if isinstance(error, ExceptionGroup) else error


def _announcer(command: str) -> Callable[[str], None]:
    """Return a function that prints the URL of the health page."""
    return lambda url: typer.echo(f"padwatch {command}: {url}readyz")


def _stream_settings(plant: PlantFile) -> StreamSettings:
    """Return the settings [stream] of a plant file.

    Raises `CommandError` with exit code 2 if the plant file has none.
    """
    if plant.stream is None:
        fail(
            "the plant file has no [stream]: add one with the servers of NATS, or use `padwatch"
            " run`, which needs none",
            2,
        )
    return plant.stream


def demo(
    port: Annotated[int, typer.Option(min=0, max=65535, help="HTTP port.")] = 8080,
    data_folder: Annotated[
        Path | None, typer.Option(help="Folder of the database instead of ./var/demo.")
    ] = None,
    plain: Annotated[
        bool, typer.Option("--plain", help="Without a simulated past and without faults.")
    ] = False,
) -> None:
    """Run padwatch with two simulated 700 MW units, read from simulated DAQs by Modbus TCP."""
    from service.cli.daq import daq_process

    path = example_path(DEMO if plain else DEMO_LIFE)
    plant = load_plant_file(path)
    if data_folder is not None:
        service = plant.service.model_copy(update={"data_folder": str(data_folder)})
        plant = plant.model_copy(update={"service": service})
    with ExitStack() as stack:
        stack.enter_context(terminal_to_itself())
        try:  # before the history is simulated, which takes half a minute
            listener = stack.enter_context(listener_of(plant, port))
        except PortInUseError as error:
            other = f"--port {port + 1}, or make run PORT={port + 1}"
            fail(f"{error}; use another port: {other}")
        if not plain:
            _give_past(plant)
        daq = stack.enter_context(daq_process([str(path)]))
        ports = ", ".join(f"{found['port']} ({unit})" for unit, found in daq.endpoints.items())
        typer.echo(f"padwatch: simulated DAQs on loopback, ports {ports}")
        run_plant(daq.attached(plant), listener, is_demo=True)


def _give_past(plant: PlantFile) -> None:
    """Fill an empty store with a simulated year."""
    from service.cli.offline.demo_history import fill, without_past
    from service.measuring.simulated_sources import simulated_history

    now_ns = SystemClock().now_ns()
    with closing(open_store(plant)) as store:
        new = without_past(store.films, plant)
        if new:
            typer.echo("padwatch: simulating the year before this start …")
            lives = {unit.id: simulated_history(unit, now_ns) for unit in new}
            fill(store.films, plant, lives, now_ns)
