"""`padwatch replay`: play recordings through the whole service, directly or over a real link."""

from collections.abc import Awaitable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from acquisition.errors import LinkError
from service.app.listener import listener_of
from service.app.measuring_process import run_service
from service.app.process import Host
from service.app.recordings import (
    PlayedOut,
    recordings_by_unit,
    replay_folder,
    replay_source,
    replayed_plant,
)
from service.app.simulated_daq import Wire, over_wire
from service.app.storage import database_path
from service.cli.daq import RunningDaq, SpeedOption, daq_process
from service.cli.offline.reanalysis import stiffness_lines
from service.cli.options import JsonOutput, PlantOption, fail, option, print_result
from service.cli.processes import announce
from service.measuring.live_view import LiveView
from service.measuring.sources import WatchedUnit, source_of, watched_units
from service.runtime.process import run_to_its_end
from service.settings.plant import PlantFile, load_plant_file
from service.settings.storage import Origin


def replay(
    recordings: Annotated[list[Path], typer.Argument(help="Folders of the recordings.")],
    plant: PlantOption,
    through: Annotated[Wire | None, option("Protocol of a simulated DAQ to play through.")] = None,
    speed: SpeedOption = 1.0,
    out: Annotated[Path | None, option("Folder of the results [<data folder>/replays/…]")] = None,
    serve: Annotated[
        bool, typer.Option(help="Keep serving the results until Ctrl-C after the replay.")
    ] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="HTTP port; 0: any free one.")] = 0,
    json_output: JsonOutput = False,
) -> None:
    """Play recordings through acquisition, analysis, store and dashboard, as if they happened now.

    All pages and answers show that it is a replay, and its results have a database of their own.
    """
    file = load_plant_file(plant)
    units = recordings_by_unit(recordings, file)
    folder = out or replay_folder(file, units.values(), SystemClock().now_ns())
    played = replayed_plant(file, units, folder)
    database = database_path(played)
    if database.exists():  # its alarms would be resumed
        fail(f"{database} contains results already; use a new folder for each replay")
    with (
        _watched(played, plant, units, through, speed, serve) as (attached, watched, daq),
        listener_of(attached, port) as listener,
    ):
        service = run_service(
            *(attached, watched, Host(listener, SystemClock(), announce)),
            origin=Origin.REPLAY,
            ends=not serve,
            at_end=None if json_output else partial(_print_stiffness, played),
        )
        run_to_its_end(_play(service, daq, database, json_output))


@contextmanager
def _watched(
    plant: PlantFile,
    plant_path: Path,
    units: Mapping[str, Path],
    through: Wire | None,
    speed: float,
    serve: bool,
) -> Iterator[tuple[PlantFile, Mapping[str, WatchedUnit], RunningDaq | None]]:
    clock = SystemClock()
    if through is None:
        watched = watched_units(
            plant, lambda unit: replay_source(units[unit.id], unit, clock, speed or None)
        )
        yield plant, watched, None
        return
    arguments = [str(plant_path), "--through", through.value, "--speed", str(speed)]
    for folder in units.values():
        arguments += ["--recording", str(folder)]
    with daq_process(arguments) as daq:
        attached = daq.attached(over_wire(plant, through))
        gone = None if serve else daq.gone
        watched = watched_units(
            attached, lambda unit: PlayedOut(source_of(unit, clock), daq.over[unit.id], gone)
        )
        yield attached, watched, daq


def _print_stiffness(plant: PlantFile, live: LiveView) -> None:
    """Print the film stiffness of each bearing at the end of the recordings."""
    typer.echo("padwatch: finished; the last results are")
    for unit in plant.unit:
        for bearing in unit.bearing:
            found = live.assessment(unit.id, bearing.id)
            lines = (
                [f"{unit.id} {bearing.id}: no result"] if found is None else stiffness_lines(found)
            )
            for line in lines:
                typer.echo(f"  {line}")


async def _play(
    service: Awaitable[None],
    daq: RunningDaq | None,
    database: Path,
    json_output: bool,
) -> None:
    await service
    if daq is not None and daq.has_failed:
        raise LinkError("results are incomplete: the simulated DAQ ended early; repeat the replay")
    results = {"database": str(database)}
    print_result(results, [f"results: {database}"], json_output, indent=None)
