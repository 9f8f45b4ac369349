"""A task that was told to stop, and whose library did not hear it."""

import asyncio


def n_stops() -> int:
    """How often the current task was told to stop.

    Before Python 3.13 a task group that fails while its task waits for it leaves its count behind.
    """
    task = asyncio.current_task()
    return 0 if task is None else task.cancelling()


def let_stop_through(n_before: int = 0) -> None:
    """End a task that was told to stop while a library waited.

    Before Python 3.12 `asyncio.wait_for` loses the cancellation if what it waits for comes at the
    same moment (CPython issue 86296); the task would then go on for ever. To be called behind
    every wait of a library that uses it.

    Parameters
    ----------
    n_before
        `n_stops` before the wait, where the task has waited for task groups of its own.
    """
    if n_stops() > n_before:
        raise asyncio.CancelledError
