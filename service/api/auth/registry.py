"""`AccessRegistry`: who and what may come in, for those who change it."""

from collections.abc import Sequence

from acquisition.clock import Clock
from service.api.auth.people import People, create_key
from service.api.auth.work import AccessWork
from service.store.access.identities import ApiKey, Role
from service.store.access.port import AccessStore, Account


class AccessRegistry:
    """Accounts and keys, away from the event loop; all that is changed is on the disk then.

    Parameters
    ----------
    work
        Where it is done.
    """

    def __init__(self, store: AccessStore, people: People, work: AccessWork, clock: Clock) -> None:
        self._store, self._people, self._work, self._clock = store, people, work, clock

    async def add(self, name: str, role: Role, password: str) -> str:
        """Add an account whose password is to be changed at its first login; return its name.

        Raises
        ------
        NameRefusedError, PasswordRefusedError, AccessRefusedError, TooManyLoginsError
            If one is not accepted, there is one of that name, or too many are hashed just now.
        """
        now_ns = self._clock.now_ns()
        return await self._work.hashed(
            lambda: self._people.add(name, role, password, now_ns, must_change=True)
        )

    async def set_password(self, name: str, password: str, must_change: bool) -> None:
        """Change a password; all sessions of the account end.

        Parameters
        ----------
        must_change
            Whether it is to be changed at the next login: who sets it is somebody else.

        Raises
        ------
        PasswordRefusedError, AccessRefusedError, TooManyLoginsError
            If it is not accepted, there is no such account, or too many are hashed just now.
        """
        now_ns = self._clock.now_ns()
        await self._work.hashed(
            lambda: self._people.set_password(name, password, now_ns, must_change)
        )

    async def accounts(self) -> Sequence[Account]:
        """Every account, by name."""
        return await self._work.looked_up(self._store.accounts.all)

    async def account(self, name: str) -> Account | None:
        """An account; None if there is none of that name."""
        return await self._work.looked_up(lambda: self._store.accounts.get(name))

    async def set_role(self, name: str, role: Role) -> None:
        """Change a role. Raises `AccessRefusedError` if no admin would be left, or none such."""
        now_ns = self._clock.now_ns()
        await self._work.looked_up(lambda: self._store.accounts.set_role(name, role, now_ns))

    async def remove(self, name: str) -> None:
        """Remove an account. Raises `AccessRefusedError` if that cannot be."""
        now_ns = self._clock.now_ns()
        await self._work.looked_up(lambda: self._store.accounts.remove(name, now_ns))

    async def keys(self) -> Sequence[ApiKey]:
        """Every key that ever was, oldest first."""
        return await self._work.looked_up(self._store.keys.all)

    async def create_key(
        self, name: str, role: Role, units: Sequence[str], days: int
    ) -> tuple[ApiKey, str]:
        """Make a key: what is stored, and the key itself.

        Raises
        ------
        NameRefusedError, AccessRefusedError
            If the name is not accepted, or no such key can be made.
        """
        now_ns = self._clock.now_ns()
        return await self._work.looked_up(
            lambda: create_key(self._store, name, role, units, days, now_ns)
        )

    async def revoke_key(self, id_: str) -> bool:
        """Take a key back for ever; whether there is such a key."""
        now_ns = self._clock.now_ns()
        is_there = await self._work.looked_up(lambda: self._store.keys.get(id_)) is not None
        if is_there:
            await self._work.looked_up(lambda: self._store.keys.revoke(id_, now_ns))
        return is_there
