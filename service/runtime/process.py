"""Process set-up: event loop, signals, exit, memory allocation, logging, author in files."""

import asyncio
import ctypes
import gc
import getpass
import os
import platform
import signal
import sys
from collections.abc import Coroutine
from contextlib import suppress
from importlib.metadata import version
from threading import Timer
from typing import Any, NoReturn

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Parameters of mallopt(3) in the GNU C library (malloc.h)."""

LARGE_BYTES = 1 << 20
KEPT_BYTES = 1 << 24
"""Free memory at the end of the heap that is not returned to the operating system. The arrays of a
segment take about 8 MiB; page faults of returned memory took half the time of a segment."""


def return_large_pieces() -> None:
    """Configure the C library to return the memory of large arrays immediately when freed.

    By default the GNU C library raises its mmap threshold to the size of the largest freed block,
    up to 32 MiB (mallopt(3)). Arrays of later results then lie on the heap between long-lived
    blocks and fragment it, and the process keeps more memory than it uses. Another C library is
    left unchanged.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(MMAP_THRESHOLD, LARGE_BYTES)
        mallopt(TRIM_THRESHOLD, KEPT_BYTES)


GC_ALLOCATIONS = 20_000
"""Number of new objects after which the youngest are collected; the default is 700."""


def exempt_start() -> None:
    """Exempt all present objects from garbage collection, and collect later objects less often.

    The objects of the start are permanent, and a collection that scans them takes 50 ms or more.
    Later ones are mostly freed without it, because little of padwatch refers to itself.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(GC_ALLOCATIONS, 20, 20)


LEAVE_S = 0.5
"""Maximum wait for running threads after the end of the program."""

SWITCH_S = 0.001
"""Thread switch interval of the interpreter: maximum wait of the event loop for a computing thread.
The default is five times as long, and each response includes several such waits."""


def run_to_its_end(program: Coroutine[Any, Any, None]) -> None:
    """Run the main coroutine `program`, which must write all data before it returns.

    Afterwards the event loop waits for threads of cancelled requests without a time limit. A
    thread cannot be stopped, so the process exits after `LEAVE_S`.
    """
    import uvloop

    sys.setswitchinterval(SWITCH_S)
    return_large_pieces()
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(program)
        leaving = Timer(LEAVE_S, _leave_threads)
        leaving.daemon = True
        leaving.start()
    leaving.cancel()


def leave(code: int = 0) -> NoReturn:
    """Exit the process immediately, without the finalizers of libraries and threads.

    The finalizers may exceed the time limit of a stop, and sometimes abort the process: threads of
    Arrow may run while its objects are destroyed (apache/arrow#34314).
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):  # the reader has closed the pipe
            stream.flush()
    os._exit(code)


def _leave_threads() -> None:
    import structlog

    structlog.get_logger().warning("exiting while threads are still running")
    leave()


def set_up_logging() -> None:
    """Configure logging to standard error: coloured lines on a terminal, otherwise JSON lines."""
    import structlog

    on_terminal = sys.stderr.isatty()
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.dev.ConsoleRenderer() if on_terminal else structlog.processors.JSONRenderer(),
        ],
        logger_factory=structlog.PrintLoggerFactory(sys.stderr),
    )


def made_by() -> str:
    """Return program version, user and host as text, for the metadata of a file."""
    return f"padwatch {version('padwatch')}, {person()}"[:200]


def person() -> str:
    """Return the user and the host of this process as the text ``user on host``."""
    try:
        name = getpass.getuser()
    except (KeyError, OSError):  # a user of a container may have no name
        name = f"user {os.getuid()}"
    return f"{name} on {platform.node()}"


def stop_on_signals() -> asyncio.Event:
    """Return an event that SIGINT and SIGTERM set; call it in the running event loop."""
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stopped.set)
    return stopped
