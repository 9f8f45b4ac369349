"""The HTTP application: API, health and metrics."""

from importlib.metadata import version

from fastapi import Depends

from service.api.alarm_rate_routes import alarm_rate_router
from service.api.alarm_routes import alarm_by_id_router, alarm_router, operation_router
from service.api.audit_routes import audit_router
from service.api.audit_trail import AuditTrail
from service.api.auth.account_routes import account_router
from service.api.auth.application import GuardedApi
from service.api.auth.desk import AccessDesk
from service.api.auth.key_routes import key_router
from service.api.auth.refusals import Refusals
from service.api.auth.session_routes import session_router
from service.api.baseline_routes import baseline_action_router, baseline_router
from service.api.bearing_routes import bearing_router, gap_router
from service.api.centre_routes import centre_router
from service.api.channel_routes import channel_router
from service.api.configuration_routes import configuration_router
from service.api.context import Context
from service.api.delivery_routes import delivery_router
from service.api.film_routes import film_router
from service.api.health_routes import health_router
from service.api.metrics_routes import metrics_router
from service.api.motion_routes import motion_router, recorded_motion_router
from service.api.order1_reference_routes import order1_reference_router
from service.api.origin_header import OriginHeader
from service.api.plant_routes import plant_router
from service.api.problems import (
    any_other_problem,
    install_problem_handlers,
    refuse_unknown_parameters,
)
from service.api.recording_routes import recording_router
from service.api.reference_routes import reference_router
from service.api.revalidation import Revalidation
from service.api.source_routes import source_router
from service.api.spectra_routes import spectra_router
from service.api.trend_routes import trend_router

DESCRIPTION = """
Oil-film stiffness of hydrogenerator guide bearings, measured while the machine runs.

Numbers that cannot be known are `null` with a `level` and a `reason`. Amplitudes are zero-to-peak.
Times are UTC, RFC 3339. Errors are problem documents (RFC 9457).
"""


def create_app(context: Context) -> GuardedApi:
    """Put the API together; pages and evidence are added by whoever has them."""
    app = GuardedApi(
        title="padwatch",
        version=version("padwatch"),
        description=DESCRIPTION,
        openapi_url="/api/v1/openapi.json",
        docs_url=None,  # its pages would load scripts from elsewhere
        redoc_url=None,
        responses=any_other_problem(),
    )
    app.add_middleware(Revalidation, clock=context.clock)
    desk = context.access or AccessDesk(context.store.access, context.clock)
    app.stand_behind(desk)
    app.add_middleware(OriginHeader, origin=context.origin)
    refusals = context.refusals or Refusals(context.store.audit, context.clock)
    app.add_middleware(AuditTrail, refusals=refusals, clock=context.clock)
    install_problem_handlers(app)
    for router in (
        health_router(context),
        plant_router(context),
        channel_router(context),
        source_router(context),
        configuration_router(context),
        gap_router(context),
        bearing_router(context),
        trend_router(context),
        spectra_router(context),
        motion_router(context),
        centre_router(context),
        reference_router(context),
        film_router(context),
        baseline_router(context),
        baseline_action_router(context),
        alarm_router(context),
        alarm_rate_router(context),
        order1_reference_router(context),
        operation_router(context),
        recording_router(context),
        recorded_motion_router(context),
        delivery_router(context),
        audit_router(context),
        alarm_by_id_router(context),
        session_router(context, desk),
        account_router(desk.registry),
        key_router(context, desk.registry),
    ):
        app.include_router(router, dependencies=[Depends(refuse_unknown_parameters)])
    if context.metrics is not None:
        app.include_router(metrics_router(context.metrics))
    return app
