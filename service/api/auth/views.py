"""What is said about who asks, accounts and keys."""

from typing import Any

from service.api.auth.account_models import AccountModel
from service.api.auth.desk import AccessDesk, Caller
from service.api.auth.session_models import SessionModel
from service.runtime.times import rfc3339
from service.store.access.identities import ApiKey, Permission, Role
from service.store.access.port import Account


async def session_model(caller: Caller, desk: AccessDesk) -> SessionModel:
    """Who asks, and what he may do."""
    identity = caller.identity
    may_all = identity is not None and (identity.is_proven or identity.role is Role.ADMIN)
    needs_set_up = not may_all and not await desk.has_accounts()
    return SessionModel(
        login_required=caller.must_log_in,
        set_up_needed=needs_set_up,
        password_change_needed=identity is not None and identity.must_change_password,
        name=identity.name if identity is not None and identity.is_proven else None,
        role=identity.role.value if identity is not None else None,
        permissions=[p.value for p in Permission if identity is not None and identity.role.may(p)],
    )


def account_model(account: Account) -> AccountModel:
    """What is shown of an account: all but the hash of its password."""
    return AccountModel(
        name=account.name,
        role=account.role.value,
        created=rfc3339(account.created_ns),
        password_set=rfc3339(account.password_ns),
    )


def key_model(key: ApiKey, now_ns: int) -> dict[str, Any]:
    """What is shown of a key: all but its digest."""
    return {
        "id": key.id,
        "name": key.name,
        "role": key.role.value,
        "units": list(key.units),
        "state": key.state(now_ns).value,
        "created": rfc3339(key.created_ns),
        "expires": rfc3339(key.expires_ns),
        "used": None if key.used_ns is None else rfc3339(key.used_ns),
        "revoked": None if key.revoked_ns is None else rfc3339(key.revoked_ns),
    }
