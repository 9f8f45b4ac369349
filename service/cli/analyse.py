"""`padwatch analyse`: blocks from a stream in, results to the store out."""

import os
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from service.api.http.listening import PortInUseError, listen
from service.app.health.serving import HOST
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.cli.stream import stream_settings
from service.cluster.partition import Partition
from service.cluster.stream.errors import StreamAnewError
from service.measuring.sources import monitor_of
from service.runtime.process import leave, run_to_its_end
from service.runtime.service_manager import ServiceManager
from service.settings.plant import PlantFile
from service.store.port import StoreError


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
    from service.app.analyse_program import run_analyse

    plant = read_plant_file(plant_file)
    settings = stream_settings(plant)
    part, mine = _part(plant, partition)
    monitors = {unit.id: monitor_of(unit, plant.analysis) for unit in mine.unit}
    try:
        with listen(HOST, settings.analyse_port if port is None else port) as listener:
            clock, manager = SystemClock(), ServiceManager(os.environ)
            run_to_its_end(
                run_analyse(plant, part, settings, monitors, listener, clock, announce, manager)
            )
    except* (PortInUseError, StoreError, StreamAnewError) as group:
        fail(f"padwatch: {_first(group)}")
    leave()


def announce(url: str) -> None:
    """Tell where the health page is."""
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
