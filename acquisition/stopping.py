"""A task that was told to stop, and whose library did not hear it."""

import asyncio


def let_stop_through() -> None:
    """End a task that was told to stop while a library waited.

    Before Python 3.12 `asyncio.wait_for` loses the cancellation if what it waits for comes at the
    same moment (CPython issue 86296); the task would then go on for ever. To be called behind
    every wait of a library that uses it.
    """
    task = asyncio.current_task()
    if task is not None and task.cancelling():
        raise asyncio.CancelledError
