"""Who may do what: roles, accounts, sessions and keys as values."""

import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from hashlib import sha256
from types import MappingProxyType


class Permission(StrEnum):
    """Something that an operation of the service needs."""

    READ = "read"
    """See the plant: results, alarms, evidence, health."""

    ACT_ON_ALARMS = "act_on_alarms"
    """Acknowledge, comment and shelve alarms."""

    CHANGE_MEASURING = "change_measuring"
    """References, baselines, alarms out of service, recordings, sending again."""

    READ_AUDIT = "read_audit"
    """See who did what."""

    CHANGE_ACCESS = "change_access"
    """Accounts and keys."""


class Role(StrEnum):
    """What somebody is to the plant, from the least to the most."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ENGINEER = "engineer"
    ADMIN = "admin"

    @property
    def rank(self) -> int:
        """Place in the order of roles; higher roles may all that lower ones may."""
        return tuple(Role).index(self)

    def may(self, permission: Permission) -> bool:
        """Whether the role has a permission."""
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
"""The lowest role that has each permission."""


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


NS_PER_S = 1_000_000_000


@dataclass(frozen=True)
class Session:
    """A login of an account, as it is stored.

    Parameters
    ----------
    digest
        Of the token in the browser's cookie.
    seen_ns
        When it was last used, to `SessionLimits.step_s`.
    """

    digest: bytes = field(repr=False)
    account: str
    created_ns: int
    seen_ns: int


@dataclass(frozen=True)
class SessionLimits:
    """When a login ends by itself.

    Parameters
    ----------
    idle_s
        After the last use.
    absolute_s
        After the login, whatever is done with it.
    step_s
        How exactly the last use is noted; each note is a write to the disk.
    slack_s
        How far a session may lie in the future: a host's clock may be put right by so much.
    """

    idle_s: float = 1800.0
    absolute_s: float = 43_200.0
    step_s: float = 60.0
    slack_s: float = 300.0

    def is_live(self, session: Session, now_ns: int) -> bool:
        """Whether a session may still be used.

        One from the future is not: a clock that was years ahead must leave no eternal logins.
        """
        age_s = (now_ns - session.created_ns) / NS_PER_S
        idle_s = (now_ns - session.seen_ns) / NS_PER_S
        return -self.slack_s <= age_s < self.absolute_s and -self.slack_s <= idle_s < self.idle_s

    def is_news(self, session: Session, now_ns: int) -> bool:
        """Whether the last use is so long ago that this one is to be noted."""
        return now_ns - session.seen_ns >= self.step_s * NS_PER_S

    def oldest_ns(self, now_ns: int) -> int:
        """Sessions that were begun before this are over."""
        return now_ns - round(self.absolute_s * NS_PER_S)


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


MAX_NAME = 64
NAME = re.compile(r"[a-z0-9](?:[a-z0-9._@-]{0,62}[a-z0-9])?", re.ASCII)


class NameRefusedError(ValueError):
    """No name for an account or a key; the message says what is."""


def account_name(written: str) -> str:
    """Bring a name to the one way in which it is stored: a name is not told apart by its case.

    Raises
    ------
    NameRefusedError
        If it is none.
    """
    name = written.strip().lower()
    if NAME.fullmatch(name) is None:
        raise NameRefusedError(
            f"a name has 1 to {MAX_NAME} of a-z 0-9 . _ @ - and begins and ends with a letter"
            " or a digit"
        )
    return name


N_BYTES = 32
"""256 bits: a digest without salt or stretching is enough, nobody can guess through it."""

KEY_ID_BYTES = 6
TOKEN = re.compile(r"[A-Za-z0-9_-]{43}", re.ASCII)
KEY = re.compile(r"pw_([0-9a-f]{12})_[A-Za-z0-9_-]{43}", re.ASCII)


def new_token() -> str:
    """Draw a token for a session or for setting up."""
    return secrets.token_urlsafe(N_BYTES)


def new_key() -> tuple[str, str]:
    """Draw a key for a machine: its public id and the whole key, which begins with it."""
    id_ = secrets.token_hex(KEY_ID_BYTES)
    return id_, f"pw_{id_}_{secrets.token_urlsafe(N_BYTES)}"


def key_id(key: str) -> str | None:
    """Read the public id in a key; None if it is no key at all."""
    found = KEY.fullmatch(key)
    return found.group(1) if found else None


def is_token(text: str) -> bool:
    """Whether a text could be a token at all."""
    return TOKEN.fullmatch(text) is not None


def digest(token: str) -> bytes:
    """What is stored of a token."""
    return sha256(token.encode()).digest()


def is_token_of(token: str, stored: bytes) -> bool:
    """Whether a token has a stored digest, in a time that does not tell how nearly."""
    return secrets.compare_digest(digest(token), stored)
