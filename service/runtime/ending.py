"""An end that does not wait for threads which still work for nobody."""

import asyncio
import os
import sys
from collections.abc import Coroutine
from contextlib import suppress
from threading import Timer
from typing import Any, NoReturn

import structlog
import uvloop

from service.runtime.heap import return_large_pieces

LEAVE_S = 0.5
"""What threads get to finish in after the program has ended."""

SWITCH_S = 0.001
"""How long a thread may compute while the event loop waits for its turn; by default five times as
long, which every answer would wait for several times."""

log = structlog.get_logger()


def run_to_its_end(program: Coroutine[Any, Any, None]) -> None:
    """Run a program that leaves nothing unwritten when it returns.

    The event loop would wait without limit for threads that have begun to read or compute what
    nobody is there for any more; no thread can be stopped from outside, but the process can.
    """
    sys.setswitchinterval(SWITCH_S)
    return_large_pieces()
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        runner.run(program)
        leaving = Timer(LEAVE_S, _leave_threads)
        leaving.daemon = True
        leaving.start()
    leaving.cancel()


def leave(code: int = 0) -> NoReturn:
    """End the process now, without taking libraries and threads down.

    That would last longer than a stop may, and now and then ends in an abort: Arrow's threads may
    still be there when its parts are destroyed (apache/arrow#34314).
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):  # whoever read it has gone
            stream.flush()
    os._exit(code)


def _leave_threads() -> None:
    log.warning("threads that still work for nobody are left behind")
    leave()
