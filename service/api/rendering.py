"""Large answers are put together in a thread: the event loop only sends the bytes."""

import asyncio
from collections.abc import Callable, Hashable
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


class Renderings:
    """Large answers about what seldom changes, each rendered once for all who ask.

    Parameters
    ----------
    n_kept
        Most that are kept; the one asked for longest ago goes first.
    """

    def __init__(self, n_kept: int = 16) -> None:
        self._n_kept = n_kept
        self._kept: dict[Hashable, tuple[object, bytes, str]] = {}

    async def of(self, place: Hashable, told: T, make: Callable[[T], BaseModel]) -> Response:
        """What is told in a place, by the object that it is told of: another one is news."""
        kept = self._kept.pop(place, None)
        if kept is None or kept[0] is not told:
            kept = (told, *await worked(lambda: _content(make(told))))
        self._kept[place] = kept
        while len(self._kept) > self._n_kept:
            del self._kept[next(iter(self._kept))]
        return Response(kept[1], media_type=JSON, headers={"ETag": kept[2]})


def _json(model: BaseModel) -> Response:
    content, tag = _content(model)
    return Response(content, media_type=JSON, headers={"ETag": tag})


def _content(model: BaseModel) -> tuple[bytes, str]:
    content = model.model_dump_json().encode()
    return content, tag_of(digest_of(content))


def _dated(model: Dated) -> Response:
    content = model.model_dump_json().encode()
    undated = content.replace(f'"time":"{model.time}"'.encode(), b"", 1)
    return Response(content, media_type=JSON, headers={"ETag": tag_of(digest_of(undated))})
