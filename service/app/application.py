"""The whole HTTP application: the API with evidence of alarms and the dashboard."""

from fastapi import Depends

from service.api.answers import EditionHeader
from service.api.app import GuardedApi, create_app
from service.api.context import Context
from service.api.problems import refuse_unknown_parameters
from service.dashboard.assets import edition
from service.dashboard.routes import dashboard_router
from service.reports.desk import EvidenceDesk
from service.reports.routes import evidence_router


def application(context: Context, evidence: EvidenceDesk | None = None) -> GuardedApi:
    """Put the application together.

    Parameters
    ----------
    evidence
        Hands out evidence of alarms; None where none is kept.
    """
    app = create_app(context)
    app.add_middleware(EditionHeader, edition=edition())
    guarded = [Depends(refuse_unknown_parameters)]
    app.include_router(evidence_router(context, evidence), dependencies=guarded)
    app.include_router(dashboard_router())
    app.require_declarations()
    return app
