"""Who is behind a request, once that is known."""

from dataclasses import dataclass
from enum import StrEnum

from service.store.access.roles import Permission, Role


class Means(StrEnum):
    """How somebody showed who they are."""

    SESSION = "session"
    KEY = "key"

    LOCAL = "local"
    """By being on this computer."""


@dataclass(frozen=True)
class Identity:
    """A person or machine whose right to be here has been checked for this one request.

    Parameters
    ----------
    name
        Of the account or the key, or `LOCAL`.
    role
        As it is now, not as it was at login.
    units
        The only units that are open to it; empty for all.
    must_change_password
        Whether nothing is open to it before it has changed a password that somebody else has set.
    """

    name: str
    role: Role
    means: Means
    units: tuple[str, ...] = ()
    must_change_password: bool = False

    @property
    def actor(self) -> str:
        """What is written beside actions; a key is told from an account of the same name."""
        return f"key:{self.name}" if self.means is Means.KEY else self.name

    @property
    def is_proven(self) -> bool:
        """Whether its name is more than a place."""
        return self.means is not Means.LOCAL

    def may(self, permission: Permission, unit: str | None = None) -> bool:
        """Whether it may do something, to a unit or to what belongs to no single unit.

        A key for some units may see, but not change, what belongs to no single unit.
        """
        if not self.role.may(permission):
            return False
        if not self.units:
            return True
        return permission is Permission.READ if unit is None else unit in self.units


LOCAL = "local"
"""Name of a program or browser on this computer that shows nothing."""
