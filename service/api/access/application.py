"""An application whose routes all say what they need, and that holds everybody to it."""

from collections.abc import Mapping
from threading import Lock
from typing import Any

from fastapi import Depends, FastAPI

from service.api.access.declared import Declared, declared
from service.api.access.desk import AccessDesk
from service.api.access.gate import Gate, require_declared
from service.api.access.openapi import describe_access
from service.api.description import describe_answers


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
        self._describing = Lock()

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
