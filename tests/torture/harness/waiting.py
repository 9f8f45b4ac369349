"""Work that goes on beside a test, and waiting for what comes of it."""

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from typing import Any

PATIENCE_S = 60.0
"""Until a test gives up; none waits that long when all is well."""


async def until(is_so: Callable[[], object]) -> None:
    """Let others go on until something is so.

    Raises
    ------
    TimeoutError
        After a minute.
    """
    async with asyncio.timeout(PATIENCE_S):
        while not is_so():
            await asyncio.sleep(0.001)


@asynccontextmanager
async def at_work(*work: Coroutine[Any, Any, object]) -> AsyncIterator[None]:
    """Run coroutines until the context is left; an error of one is raised there."""
    tasks = [asyncio.create_task(one) for one in work]
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)
    for task in tasks:
        if not task.cancelled():
            task.result()
