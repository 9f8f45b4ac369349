"""Applications that share their published description, which takes 0.25 s to make."""

from typing import Any

from service.api.app import GuardedApi
from service.api.context import Context
from service.app.serving_process import application
from service.reports.routes import EvidenceService

_DOCUMENTS: dict[frozenset[str], dict[str, Any]] = {}


def described_app(context: Context, evidence: EvidenceService | None = None) -> GuardedApi:
    """Build the application of a context, with the description of an earlier one like it."""
    app = application(context, evidence)
    operations, describe = frozenset(app.declared), app.openapi

    def openapi() -> dict[str, Any]:
        found = _DOCUMENTS[operations] = describe()
        return found

    app.openapi_schema = _DOCUMENTS.get(operations)
    app.openapi = openapi  # only made where a test asks for it
    return app
