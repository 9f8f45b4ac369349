"""`AccessDesk`: what the HTTP server asks about people and machines."""

from dataclasses import dataclass, field
from functools import cached_property

from starlette.types import Scope

from acquisition.clock import Clock
from core.units import ns_from_s
from service.api.auth.backoff import Backoff
from service.api.auth.credentials import Credentials, Kind, credentials_of
from service.api.auth.doors import Doors, LoggedIn, NotLoggedIn, Refusal, tidy_name
from service.api.auth.locality import is_from_here
from service.api.auth.passwords import Hashing
from service.api.auth.people import People
from service.api.auth.registry import AccessRegistry
from service.api.auth.work import AccessWork
from service.store.access.identities import LOCAL, Identity, Means, Role, SessionLimits
from service.store.access.port import AccessStore


@dataclass(frozen=True)
class Caller:
    """Who sends a request, as far as that is known.

    Parameters
    ----------
    identity
        None for nobody in particular.
    shown
        What was shown, whatever it is worth.
    must_log_in
        Whether being where the request comes from is not enough.
    """

    identity: Identity | None
    shown: Credentials = field(repr=False)
    must_log_in: bool


class AccessDesk:
    """Tells who sends a request, and lets people in.

    Parameters
    ----------
    local_role
        Role of people and programs on this computer that show nothing; None if they must log in,
        too.
    hashing
        Of passwords; argon2id with the parameters in force unless given.
    """

    def __init__(
        self,
        store: AccessStore,
        clock: Clock,
        local_role: Role | None = Role.VIEWER,
        hashing: Hashing | None = None,
        limits: SessionLimits | None = None,
    ) -> None:
        self._store, self._clock, self._limits = store, clock, limits
        self.local_role = local_role
        self._hashing = hashing or Hashing()
        self._people = People(store, self._hashing)
        self._work = AccessWork()
        self._backoff = Backoff()
        self.registry = AccessRegistry(store, self._people, self._work, clock)

    async def caller(self, scope: Scope) -> Caller:
        """Tell who sends a request.

        Raises
        ------
        StoreError
            If the store cannot be asked.
        """
        local_role = self.local_role if is_from_here(scope) else None
        shown = credentials_of(scope["headers"], scope["scheme"])
        identity = await self._proven(shown)
        # a key that is wrong is told so; a login that is over is no worse than none
        is_nobody = identity is None and shown.kind in (Kind.NOTHING, Kind.SESSION)
        if is_nobody and local_role is not None:
            identity = Identity(LOCAL, local_role, Means.LOCAL)
        return Caller(identity, shown, must_log_in=local_role is None)

    async def log_in(self, name: str, password: str, peer: str) -> LoggedIn | NotLoggedIn:
        """Begin a session for whoever knows the password of an account.

        Raises
        ------
        TooManyLoginsError
            If too many try at the same time.
        """
        now_ns, ticks_ns = self._clock.now_ns(), ns_from_s(self._clock.monotonic_s())
        return await self._work.hashed(
            lambda: self._doors.log_in(name, password, peer, now_ns, ticks_ns),
            is_known=self._backoff.knows(tidy_name(name), peer),
        )

    async def log_out(self, token: str) -> None:
        """End a session; one that is over already is fine."""
        await self._work.looked_up(lambda: self._doors.log_out(token))

    async def set_up(self, token: str, name: str, password: str) -> bool:
        """Make the first account, an admin; whether the token was good for it.

        Raises
        ------
        NameRefusedError, PasswordRefusedError, TooManyLoginsError
            If one is not accepted, or too many are hashed just now.
        """
        now_ns = self._clock.now_ns()
        return await self._work.hashed(
            lambda: self._people.set_up(token, name, password, now_ns), is_known=False
        )

    async def offer_set_up(self) -> str | None:
        """Draw the token with which the first account is made; None if nobody needs one."""
        if self.local_role is Role.ADMIN:
            return None
        now_ns = self._clock.now_ns()
        return await self._work.looked_up(lambda: self._people.offer_set_up(now_ns))

    async def has_accounts(self) -> bool:
        """Whether anybody could log in."""
        return bool(await self._work.looked_up(self._store.accounts.all))

    def close(self) -> None:
        """Let nobody in any more: the service ends."""
        self._work.close()

    async def _proven(self, shown: Credentials) -> Identity | None:
        now_ns = self._clock.now_ns()
        if shown.kind is Kind.SESSION:
            found = await self._work.looked_up(lambda: self._doors.person(shown.secret, now_ns))
        elif shown.kind is Kind.KEY:
            found = await self._work.looked_up(lambda: self._doors.machine(shown.secret, now_ns))
        else:
            return None
        return None if isinstance(found, Refusal) else found

    @cached_property
    def _doors(self) -> Doors:
        return Doors(self._store, self._hashing, self._backoff, self._limits, self._work.note)
