"""An application whose routes all say what they need, and that holds everybody to it."""

import asyncio
import json
from collections.abc import Mapping
from threading import Lock
from typing import Any

from fastapi import Depends, FastAPI, Request, Response

from service.api.auth.declared import Declared, declared
from service.api.auth.desk import AccessDesk
from service.api.auth.gate import Gate, require_declared
from service.api.auth.openapi import describe_access
from service.api.description import describe_answers
from service.api.entity_tags import digest_of, tag_of


class GuardedApi(FastAPI):
    """FastAPI's application behind a gate.

    Parameters
    ----------
    options
        FastAPI's own.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(dependencies=[Depends(require_declared)], **options)
        self._declared: Mapping[str, Declared] = {}
        self._describing, self._rendering = Lock(), Lock()
        self._rendered: tuple[bytes, str] | None = None

    def setup(self) -> None:
        """Add the route of the published description, which FastAPI would render each time."""
        if self.openapi_url:
            self.add_route(self.openapi_url, self._published, include_in_schema=False)

    def stand_behind(self, desk: AccessDesk) -> None:
        """Put the gate before what has been added so far; later middleware stands before it."""
        self.add_middleware(Gate, declared=lambda: self.declared, desk=desk)

    def require_declarations(self) -> None:
        """Read what all routes need; called when there are no more to come.

        Raises
        ------
        UndeclaredRouteError
            If one does not say it.
        """
        self._declared = declared(self)

    @property
    def declared(self) -> Mapping[str, Declared]:
        """What each operation needs, by method and path."""
        return self._declared

    def openapi(self) -> dict[str, Any]:
        """The published description, made once: routes are no longer added.

        Whoever asks while it is being made waits, and gets no half of it.
        """
        with self._describing:
            if self.openapi_schema is not None:
                return self.openapi_schema
            document: dict[str, Any] = super().openapi()
            describe_access(document, self.declared)
            describe_answers(document)
            return document

    def rendered(self) -> tuple[bytes, str]:
        """The published description as JSON, and its entity tag; made once, which takes 0.3 s."""
        with self._rendering:
            if self._rendered is None:
                document = _json(self.openapi())
                self._rendered = document, tag_of(digest_of(document))
            return self._rendered

    async def _published(self, _: Request) -> Response:
        # where it is not there yet it is made in a thread, not on the event loop
        rendered = self._rendered
        if rendered is None:
            rendered = await asyncio.to_thread(self.rendered)
        document, tag = rendered
        return Response(document, media_type="application/json", headers={"ETag": tag})


def _json(document: dict[str, Any]) -> bytes:
    return json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()
