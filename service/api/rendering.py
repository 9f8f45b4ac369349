"""Large answers are put together in a thread: the event loop only sends the bytes."""

import asyncio
from collections.abc import Callable
from typing import Protocol, TypeVar

from fastapi import Response
from pydantic import BaseModel

from service.api.entity_tags import digest_of, tag_of

T = TypeVar("T")

JSON = "application/json"


class Dated(Protocol):
    """What says in its field ``time`` when it was asked for, and is no news by that alone."""

    time: str

    def model_dump_json(self) -> str:
        """All of it, as JSON."""
        ...


async def worked(do: Callable[[], T]) -> T:
    """Do something in a thread."""
    return await asyncio.to_thread(do)


async def rendered(make: Callable[[], BaseModel]) -> Response:
    """Build a model and its JSON in a thread, and the tag of that.

    Parameters
    ----------
    make
        Builds it; may block.
    """
    return await asyncio.to_thread(lambda: _json(make()))


async def rendered_now(make: Callable[[], Dated]) -> Response:
    """Likewise what is about now; it has the same tag until there is more news than the time.

    Parameters
    ----------
    make
        Builds it; may block. Its own time comes before any other in it.
    """
    return await asyncio.to_thread(lambda: _dated(make()))


def _json(model: BaseModel) -> Response:
    content = model.model_dump_json().encode()
    return Response(content, media_type=JSON, headers={"ETag": tag_of(digest_of(content))})


def _dated(model: Dated) -> Response:
    content = model.model_dump_json().encode()
    undated = content.replace(f'"time":"{model.time}"'.encode(), b"", 1)
    return Response(content, media_type=JSON, headers={"ETag": tag_of(digest_of(undated))})
