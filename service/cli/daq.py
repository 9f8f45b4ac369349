"""`padwatch daq`: simulated or recorded units behind a real DAQ."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
import uvloop

from acquisition.clock import FastClock, SystemClock
from acquisition.errors import AcquisitionError
from acquisition.simulated.feed import SampleFeed
from service.app.daq_program import run_daq
from service.app.daqs import daq_of
from service.app.recordings import recorded_feed, recordings_by_unit
from service.app.wires import Wire, over_wire
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.measuring.simulated_sources import simulated_feed
from service.settings.plant import PlantFile

SpeedOption = Annotated[
    float,
    typer.Option(min=0.0, max=1000.0, help="Seconds of the recording in a second; 0: unpaced."),
]


def daq(
    plant_file: PlantPath,
    recording: Annotated[
        list[Path] | None,
        typer.Option(help="Play this recording of a unit instead of simulations; repeatable."),
    ] = None,
    through: Annotated[
        Wire | None,
        typer.Option(help="Serve over this wire on loopback instead.", show_default=False),
    ] = None,
    speed: SpeedOption = 1.0,
    control: Annotated[
        bool,
        typer.Option(help="Read commands UNIT FAULT [COUNT] from standard input; its end ends it."),
    ] = False,
) -> None:
    """Serve units over the protocol of their sources, where these look for them.

    Prints one JSON line that says where each unit is found, then runs until Ctrl-C or SIGTERM.
    Unpaced, a device produces as fast as its reader reads.
    """
    plant = read_plant_file(plant_file)
    if through is not None:
        plant = over_wire(plant, through)
    clock = FastClock(SystemClock(), speed) if speed else None
    try:
        feeds = _feeds(plant, recording or [])
        servers = {
            unit.id: daq_of(unit, feeds[unit.id], clock, recorded=bool(recording))
            for unit in plant.unit
            if unit.id in feeds
        }
        uvloop.run(run_daq(servers, typer.echo, controlled=control))
    except (AcquisitionError, LookupError) as error:
        fail(f"padwatch daq: {error.args[0]}")


def _feeds(plant: PlantFile, recordings: list[Path]) -> Mapping[str, SampleFeed]:
    if recordings:
        played = recordings_by_unit(recordings, plant)
        return {u.id: recorded_feed(played[u.id], u) for u in plant.unit if u.id in played}
    clock = SystemClock()
    feeds = {unit.id: simulated_feed(unit, clock) for unit in plant.unit if unit.simulation}
    if not feeds:
        raise LookupError("no unit of this plant file has a [unit.simulation] table")
    now_ns = clock.now_ns()  # the first of them was made seconds ago
    for feed in feeds.values():
        feed.begin_at(now_ns)
    return feeds
