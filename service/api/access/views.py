"""What is said about who asks, accounts and keys."""

from service.api.access.desk import AccessDesk, Caller
from service.api.access.session_models import SessionModel
from service.security.roles import Permission


async def session_model(caller: Caller, desk: AccessDesk) -> SessionModel:
    """Who asks, and what he may do."""
    identity = caller.identity
    needs_set_up = caller.must_log_in and identity is None and not await desk.has_accounts()
    return SessionModel(
        login_required=caller.must_log_in,
        set_up_needed=needs_set_up,
        name=identity.name if identity is not None and identity.is_proven else None,
        role=identity.role.value if identity is not None else None,
        permissions=[p.value for p in Permission if identity is not None and identity.role.may(p)],
    )
