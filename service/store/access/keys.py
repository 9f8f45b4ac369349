"""Keys with which machines come in."""

from dataclasses import dataclass, field
from enum import StrEnum

from service.store.access.roles import Role

MAX_DAYS = 3650
SEEN_STEP_NS = 60 * 1_000_000_000
"""How exactly the last use is noted; each note is a write to the disk."""


class KeyState(StrEnum):
    """Whether a key opens anything."""

    VALID = "valid"
    EXPIRED = "expired"
    REVOKED = "revoked"


@dataclass(frozen=True)
class ApiKey:
    """A key as it is stored: never the key itself.

    Parameters
    ----------
    id
        Public; part of the key.
    digest
        Of the whole key.
    units
        The only units that it opens; empty for all.
    used_ns
        Its last use, to a minute; None if it never was.
    revoked_ns
        When it was taken back; None if it was not.
    """

    id: str
    name: str
    digest: bytes = field(repr=False)
    role: Role
    units: tuple[str, ...]
    created_ns: int
    expires_ns: int
    used_ns: int | None = None
    revoked_ns: int | None = None

    def state(self, now_ns: int) -> KeyState:
        """Whether it opens anything at a time."""
        if self.revoked_ns is not None:
            return KeyState.REVOKED
        return KeyState.VALID if now_ns < self.expires_ns else KeyState.EXPIRED

    def is_news(self, now_ns: int) -> bool:
        """Whether the last use is so long ago that this one is to be noted."""
        return self.used_ns is None or now_ns - self.used_ns >= SEEN_STEP_NS
