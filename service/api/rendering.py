"""Large answers are put together in a thread: the event loop only sends the bytes."""

import asyncio
from collections.abc import Callable
from typing import TypeVar

from fastapi import Response
from pydantic import BaseModel

T = TypeVar("T")


async def worked(do: Callable[[], T]) -> T:
    """Do something in a thread."""
    return await asyncio.to_thread(do)


async def rendered(make: Callable[[], BaseModel]) -> Response:
    """Build a model and its JSON in a thread.

    Parameters
    ----------
    make
        Builds it; may block.
    """
    return await asyncio.to_thread(lambda: _json(make()))


def _json(model: BaseModel) -> Response:
    return Response(model.model_dump_json(), media_type="application/json")
