"""The service on a host with a wrong clock: ``python -m harness.wrong_clock run FILE --port 0``.

The file that the environment variable WALL_CLOCK names holds by how many seconds the clock is
wrong; it is read at the start of each process, measuring and serving, and again on SIGUSR1.
"""

import os
import runpy
import signal
import sys
import time
from pathlib import Path

from acquisition.clock import SystemClock
from core.units import NS_PER_S
from harness.open_program import main
from service.runtime import child

wrong_ns = 0


def read(*_: object) -> None:
    """Read by how much the clock is wrong."""
    global wrong_ns
    wrong_s = float(Path(os.environ["WALL_CLOCK"]).read_text(encoding="ascii"))
    wrong_ns = round(wrong_s * NS_PER_S)


if __name__ == "__main__":
    read()
    signal.signal(signal.SIGUSR1, read)
    SystemClock.now_ns = lambda self: time.time_ns() + wrong_ns  # type: ignore[method-assign]  # noqa: ARG005
    if sys.argv[1:2] == ["run"]:
        child.PROGRAM = "harness.wrong_clock"
    if sys.argv[1].isdecimal():  # as a serving process, which gets the number of its socket
        runpy.run_module("service.app.serving_process", run_name="__main__")
    else:
        main()
