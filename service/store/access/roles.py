"""Roles of people and machines, and what each may do."""

from collections.abc import Mapping
from enum import StrEnum
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
        return self.rank >= LEAST_ROLE[permission].rank


LEAST_ROLE: Mapping[Permission, Role] = MappingProxyType(
    {
        Permission.READ: Role.VIEWER,
        Permission.ACT_ON_ALARMS: Role.OPERATOR,
        Permission.CHANGE_MEASURING: Role.ENGINEER,
        Permission.READ_AUDIT: Role.ENGINEER,
        Permission.CHANGE_ACCESS: Role.ADMIN,
    }
)
"""The lowest role that has each permission."""
