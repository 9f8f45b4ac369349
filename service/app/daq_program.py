"""The running simulated DAQ: servers plugged in, commands from standard input, news to its user."""

import asyncio
import json
import os
import signal
import threading
from collections.abc import Callable, Mapping
from contextlib import AsyncExitStack, suppress

from acquisition.errors import AcquisitionError
from acquisition.simulated.devices.server import DaqServer

Tell = Callable[[str], None]

MAX_COUNT = 1_000_000
"""Of one command; each takes a place in a queue."""

_STANDARD_INPUT = 0


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
    AcquisitionError
        If a server cannot listen, or cannot go on.
    """
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stopped.set)
    async with AsyncExitStack() as stack:
        for server in servers.values():
            await stack.enter_async_context(server)
        tell(json.dumps({unit: dict(server.endpoint) for unit, server in servers.items()}))
        try:
            await _serve_all(servers, tell, stopped, controlled)
        except ExceptionGroup as errors:
            _, others = errors.split(AcquisitionError)
            raise errors if others else errors.exceptions[0] from None


async def _serve_all(
    servers: Mapping[str, DaqServer], tell: Tell, stopped: asyncio.Event, controlled: bool
) -> None:
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
    lines: asyncio.Queue[str] = asyncio.Queue()
    reading = (asyncio.get_running_loop(), lines.put_nowait)
    threading.Thread(target=_read_lines, args=reading, daemon=True, name="commands").start()
    while line := await lines.get():
        tell(json.dumps(obeyed(servers, line)))
    stopped.set()


def _read_lines(loop: asyncio.AbstractEventLoop, hear: Callable[[str], None]) -> None:
    """Hand on what comes line by line, at last an empty one; it may be a file, which loops cannot.

    A loop that is closed hears no more.
    """
    with suppress(RuntimeError):
        with suppress(OSError), open(os.dup(_STANDARD_INPUT), errors="replace") as lines:
            for line in lines:
                loop.call_soon_threadsafe(hear, line)
        loop.call_soon_threadsafe(hear, "")


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
    if count and int(count[0]) > MAX_COUNT:
        return {"refused": f"COUNT is {count[0]}, at most {MAX_COUNT}"}
    if unit not in servers:
        return {"refused": f"no unit {unit} here; there are {', '.join(servers)}"}
    try:
        servers[unit].inject(fault, *map(int, count))
    except LookupError as error:
        return {"refused": str(error.args[0])}
    return {"done": " ".join(words)}
