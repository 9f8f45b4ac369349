"""Permissions, roles, login sessions and API keys, and their secret tokens."""

import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from hashlib import sha256
from types import MappingProxyType

from core.units import NS_PER_S


class Permission(StrEnum):
    """Permission for a group of operations of the service, granted by a role."""

    READ = "read"
    """Read results, alarms, evidence and health of the plant."""

    ACT_ON_ALARMS = "act_on_alarms"
    """Acknowledge, comment and shelve alarms; add notes."""

    CHANGE_MEASURING = "change_measuring"
    """Change references, baselines and recordings; take alarms out of service; resend messages."""

    READ_AUDIT = "read_audit"
    """Read the audit trail."""

    CHANGE_ACCESS = "change_access"
    """Change accounts and keys."""


class Role(StrEnum):
    """Role of an account or an API key; roles are listed from the lowest to the highest."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ENGINEER = "engineer"
    ADMIN = "admin"

    @property
    def rank(self) -> int:
        """Rank in the order of roles, from 0; a role includes the permissions of lower roles."""
        return tuple(Role).index(self)

    def may(self, permission: Permission) -> bool:
        """Return whether the role has a permission."""
        return self.rank >= MIN_ROLE[permission].rank


MIN_ROLE: Mapping[Permission, Role] = MappingProxyType(
    {
        Permission.READ: Role.VIEWER,
        Permission.ACT_ON_ALARMS: Role.OPERATOR,
        Permission.CHANGE_MEASURING: Role.ENGINEER,
        Permission.READ_AUDIT: Role.ENGINEER,
        Permission.CHANGE_ACCESS: Role.ADMIN,
    }
)
"""Lowest role that includes a permission, by permission."""


class Means(StrEnum):
    """Method of authentication."""

    SESSION = "session"
    KEY = "key"

    LOCAL = "local"
    """Request from this computer without authentication."""


@dataclass(frozen=True)
class Identity:
    """Identity of the person or program that sent a request.

    Parameters
    ----------
    name
        Name of the account or of the API key, or `LOCAL`.
    role
        Current role, which may differ from the role at login.
    units
        Units to which access is limited; empty for all.
    must_change_password
        Whether a change of the password is the only permitted operation.
    """

    name: str
    role: Role
    means: Means
    units: tuple[str, ...] = ()
    must_change_password: bool = False

    @property
    def actor(self) -> str:
        """Name for audit entries; API keys have the prefix ``key:``."""
        return f"key:{self.name}" if self.means is Means.KEY else self.name

    @property
    def is_proven(self) -> bool:
        """Whether the identity was authenticated by a session or an API key."""
        return self.means is not Means.LOCAL

    def may(self, permission: Permission, unit: str | None = None) -> bool:
        """Return whether an operation on a unit, or on the whole plant (None), is permitted.

        An API key that is limited to units may read the data of the whole plant, but may not
        change these data.
        """
        if not self.role.may(permission):
            return False
        if not self.units:
            return True
        return permission is Permission.READ if unit is None else unit in self.units


LOCAL = "local"
"""Name in the identity of an unauthenticated program or browser on this computer."""


@dataclass(frozen=True)
class Session:
    """Login session of an account, as stored; times are in ns since 1970 UTC.

    Parameters
    ----------
    digest
        SHA-256 digest of the token in the browser's cookie.
    seen_ns
        Time of the last use, to a resolution of `SessionLimits.step_s`.
    """

    digest: bytes = field(repr=False)
    account: str
    created_ns: int
    seen_ns: int


@dataclass(frozen=True)
class SessionLimits:
    """Limits of the lifetime of a session.

    Parameters
    ----------
    idle_s, absolute_s
        Maximum time since the last use, and since the login.
    step_s
        Resolution of the stored time of last use; each update is a write to the disk.
    slack_s
        Maximum time by which the times of a session may lie in the future, as after a correction of
        the host clock.
    """

    idle_s: float = 1800.0
    absolute_s: float = 43_200.0
    step_s: float = 60.0
    slack_s: float = 300.0

    def is_live(self, session: Session, now_ns: int) -> bool:
        """Return whether a session is valid at a time.

        A session with times in the future is invalid: a host clock that was years ahead must not
        leave permanent sessions.
        """
        age_s = (now_ns - session.created_ns) / NS_PER_S
        idle_s = (now_ns - session.seen_ns) / NS_PER_S
        return -self.slack_s <= age_s < self.absolute_s and -self.slack_s <= idle_s < self.idle_s

    def is_news(self, session: Session, now_ns: int) -> bool:
        """Return whether to update the stored time of last use: it is at least `step_s` old."""
        return now_ns - session.seen_ns >= self.step_s * NS_PER_S

    def oldest_ns(self, now_ns: int) -> int:
        """Return the earliest login time of a session that may be valid, in ns since 1970 UTC."""
        return now_ns - round(self.absolute_s * NS_PER_S)


MAX_DAYS = 3650
SEEN_STEP_NS = 60 * NS_PER_S
"""Resolution of an API key's stored time of last use; each update is a write to the disk."""


class KeyState(StrEnum):
    """State of an API key."""

    VALID = "valid"
    EXPIRED = "expired"
    REVOKED = "revoked"


@dataclass(frozen=True)
class ApiKey:
    """API key as stored, without the secret; times are in ns since 1970 UTC.

    Parameters
    ----------
    id
        Public identifier, which is a part of the key.
    digest
        SHA-256 digest of the whole key.
    units
        Units to which the key is limited; empty for all.
    used_ns
        Time of the last use, with a resolution of one minute; None if never used.
    revoked_ns
        Time of revocation; None if not revoked.
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
        """Return the state of the key at a time."""
        if self.revoked_ns is not None:
            return KeyState.REVOKED
        return KeyState.VALID if now_ns < self.expires_ns else KeyState.EXPIRED

    def is_news(self, now_ns: int) -> bool:
        """Return whether the stored time of last use is None or at least one minute old."""
        return self.used_ns is None or now_ns - self.used_ns >= SEEN_STEP_NS


MAX_NAME = 64
NAME = re.compile(r"[a-z0-9](?:[a-z0-9._@-]{0,62}[a-z0-9])?", re.ASCII)


class NameRefusedError(ValueError):
    """Error raised if the name of an account or an API key is invalid; it states the rules."""


def account_name(written: str) -> str:
    """Return an entered name of an account or an API key as stored: stripped, in lower case.

    Raises `NameRefusedError` if the name is invalid.
    """
    name = written.strip().lower()
    if NAME.fullmatch(name) is None:
        raise NameRefusedError(
            f"a name must have 1 to {MAX_NAME} characters of a-z, 0-9 and . _ @ -, and begin and"
            " end with a letter or a digit"
        )
    return name


N_BYTES = 32
"""Number of random bytes of a secret; 256 bits need no salt or key stretching."""

KEY_ID_BYTES = 6
TOKEN = re.compile(r"[A-Za-z0-9_-]{43}", re.ASCII)
KEY = re.compile(r"pw_([0-9a-f]{12})_[A-Za-z0-9_-]{43}", re.ASCII)


def new_token() -> str:
    """Return a random token for a session or for the set-up."""
    return secrets.token_urlsafe(N_BYTES)


def new_key() -> tuple[str, str]:
    """Return the public identifier and the whole text of a new random API key."""
    id_ = secrets.token_hex(KEY_ID_BYTES)
    return id_, f"pw_{id_}_{secrets.token_urlsafe(N_BYTES)}"


def key_id(key: str) -> str | None:
    """Return the public identifier in an API key; None if the text is not an API key."""
    found = KEY.fullmatch(key)
    return found.group(1) if found else None


def is_token(text: str) -> bool:
    """Return whether a text has the form of a token."""
    return TOKEN.fullmatch(text) is not None


def digest(token: str) -> bytes:
    """Return the SHA-256 digest of a token, as stored."""
    return sha256(token.encode()).digest()


def is_token_of(token: str, stored: bytes) -> bool:
    """Return whether a token matches a stored digest; the comparison takes constant time."""
    return secrets.compare_digest(digest(token), stored)
