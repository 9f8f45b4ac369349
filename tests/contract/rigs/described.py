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
    operations = frozenset(app.declared)
    app.openapi_schema = _DOCUMENTS.get(operations)
    _DOCUMENTS[operations] = app.openapi()
    return app
