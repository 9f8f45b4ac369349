"""The running simulated DAQ: servers plugged in, commands from standard input, news to its user."""

import asyncio
import json
import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import AsyncExitStack

from acquisition.daq.port import DaqServer

Tell = Callable[[str], None]


async def run_daq(servers: Mapping[str, DaqServer], tell: Tell, *, controlled: bool) -> None:
    """Serve until SIGINT or SIGTERM, or until standard input ends.

    Tells, each as one line of JSON: first where each unit's reader finds it; later
    ``{"ended": unit}`` when a unit's recording is over, and the answer to each command.

    Parameters
    ----------
    controlled
        Whether commands are read from standard input, whose end then ends the DAQ.

    Raises
    ------
    LinkError
        If a server cannot listen.
    """
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stopped.set)
    async with AsyncExitStack() as stack:
        for server in servers.values():
            await stack.enter_async_context(server)
        tell(json.dumps({unit: dict(server.endpoint) for unit, server in servers.items()}))
        async with asyncio.TaskGroup() as tasks:
            running = [tasks.create_task(_serve(*entry, tell)) for entry in servers.items()]
            if controlled:
                running.append(tasks.create_task(_obey(servers, tell, stopped)))
            await stopped.wait()
            for task in running:
                task.cancel()


async def _serve(unit: str, server: DaqServer, tell: Tell) -> None:
    await server.run()
    tell(json.dumps({"ended": unit}))


async def _obey(servers: Mapping[str, DaqServer], tell: Tell, stopped: asyncio.Event) -> None:
    reader = asyncio.StreamReader()
    loop = asyncio.get_running_loop()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    while line := await reader.readline():
        tell(json.dumps(obeyed(servers, line.decode(errors="replace"))))
    stopped.set()


def obeyed(servers: Mapping[str, DaqServer], line: str) -> dict[str, str]:
    """Do what one command says: ``UNIT FAULT [COUNT]``.

    Returns
    -------
    dict
        The command under "done", or what is wrong with it under "refused".
    """
    words = line.split()
    if len(words) not in (2, 3) or (len(words) == 3 and not words[2].isdecimal()):
        return {"refused": f"{line.strip()!r} is not UNIT FAULT [COUNT]"}
    unit, fault, *count = words
    if unit not in servers:
        return {"refused": f"no unit {unit} here; there are {', '.join(servers)}"}
    try:
        servers[unit].inject(fault, *map(int, count))
    except LookupError as error:
        return {"refused": str(error.args[0])}
    return {"done": " ".join(words)}
