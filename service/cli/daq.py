"""`padwatch daq`: simulated units behind a real Modbus TCP DAQ."""

import asyncio
import json
import signal
import sys
from contextlib import AsyncExitStack
from typing import Annotated

import typer
import uvloop

from acquisition.clock import SystemClock
from acquisition.errors import AcquisitionError
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.settings.plant import PlantFile
from service.wiring.daqs import simulated_daq


def daq(
    plant_file: PlantPath,
    until_input_ends: Annotated[
        bool, typer.Option(help="Also end when standard input is closed, as it is by a parent.")
    ] = False,
) -> None:
    """Serve every unit that has a simulation where its Modbus source looks for it.

    Prints one JSON line with the port of each unit, then runs until Ctrl-C or SIGTERM.
    """
    plant = read_plant_file(plant_file)
    try:
        uvloop.run(_serve(plant, until_input_ends))
    except (AcquisitionError, LookupError) as error:
        fail(f"padwatch daq: {error.args[0]}")


async def _serve(plant: PlantFile, until_input_ends: bool) -> None:
    clock = SystemClock()
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stopped.set)
    servers = {unit.id: simulated_daq(unit, clock) for unit in plant.unit if unit.simulation}
    if not servers:
        raise LookupError("no unit of this plant file has a [unit.simulation] table")
    async with AsyncExitStack() as stack:
        for server in servers.values():
            await stack.enter_async_context(server)
        typer.echo(json.dumps({unit: server.port for unit, server in servers.items()}))
        async with asyncio.TaskGroup() as tasks:
            running = [tasks.create_task(server.run()) for server in servers.values()]
            if until_input_ends:
                running.append(tasks.create_task(_end_with_input(stopped)))
            await stopped.wait()
            for task in running:
                task.cancel()


async def _end_with_input(stopped: asyncio.Event) -> None:
    reader = asyncio.StreamReader()
    loop = asyncio.get_running_loop()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    await reader.read()
    stopped.set()
