"""The service on a host whose wall clock is wrong: ``python -m harness.stepped_service run FILE``.

The file named by the environment variable WALL_CLOCK holds by how many seconds it is; it is read at
the start, and again on SIGUSR1.
"""

import os
import signal
import time
from pathlib import Path

from acquisition.clock import SystemClock
from service.cli.main import main

NS_PER_S = 1_000_000_000


def step_when_told(path: Path) -> None:
    """Let the wall clock be as the file says."""
    wrong_ns = [0]

    def read(*_: object) -> None:
        wrong_ns[0] = round(float(path.read_text(encoding="ascii")) * NS_PER_S)

    def now_ns(self: SystemClock) -> int:  # noqa: ARG001
        return time.time_ns() + wrong_ns[0]

    read()
    signal.signal(signal.SIGUSR1, read)
    SystemClock.now_ns = now_ns  # type: ignore[method-assign]


if __name__ == "__main__":
    step_when_told(Path(os.environ["WALL_CLOCK"]))
    main()
