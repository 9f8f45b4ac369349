"""Who may come in, by what a plant file says."""

from acquisition.clock import Clock
from service.api.auth.authenticator import AccessDesk
from service.settings.addresses import Doorway, is_loopback, why_closed
from service.settings.plant import PlantFile
from service.store.access.port import AccessStore
from service.store.access.roles import Role
from service.store.access.sessions import SessionLimits


class ClosedError(Exception):
    """The service does not start at this address; the message says why."""


def access_desk(
    plant: PlantFile, store: AccessStore, clock: Clock, is_demo: bool = False
) -> AccessDesk:
    """What asks who somebody is.

    Parameters
    ----------
    is_demo
        Whether people and programs on this computer may do everything without a login.

    Raises
    ------
    ClosedError
        If others could reach the service, and it is not fit for that.
    StoreError
        If accounts cannot be read.
    """
    service, access = plant.service, plant.access
    doorway = Doorway(
        service.host,
        is_unix_socket=service.socket is not None,
        has_tls=service.tls is not None,
        has_account=bool(store.accounts.all()),
    )
    reason = why_closed(doorway)
    if reason is not None:
        raise ClosedError(reason)
    local_role: Role | None = Role.ADMIN if is_demo else Role.VIEWER
    if access.login or doorway.is_unix_socket or not is_loopback(service.host):
        local_role = None
    limits = SessionLimits(idle_s=60.0 * access.idle_min, absolute_s=3600.0 * access.longest_h)
    return AccessDesk(store, clock, local_role, limits=limits)
