"""What each role may do."""

import pytest

from service.security.identity import Identity, Means
from service.security.roles import LEAST_ROLE, Permission, Role

MATRIX = {
    Role.VIEWER: {Permission.READ},
    Role.OPERATOR: {Permission.READ, Permission.ACT_ON_ALARMS},
    Role.ENGINEER: set(Permission) - {Permission.CHANGE_ACCESS},
    Role.ADMIN: set(Permission),
}


@pytest.mark.parametrize("role", Role)
@pytest.mark.parametrize("permission", Permission)
def test_a_role_may_what_the_table_of_roles_says(role: Role, permission: Permission) -> None:
    assert role.may(permission) == (permission in MATRIX[role])


def test_every_permission_says_who_has_it() -> None:
    assert set(LEAST_ROLE) == set(Permission)


@pytest.mark.parametrize("permission", Permission)
def test_a_higher_role_may_all_that_a_lower_one_may(permission: Permission) -> None:
    allowed = [role.may(permission) for role in sorted(Role, key=lambda role: role.rank)]
    assert allowed == sorted(allowed)


def test_a_key_for_one_unit_opens_no_other_and_changes_nothing_of_the_plant() -> None:
    key = Identity("historian", Role.ENGINEER, Means.KEY, ("U1",))

    assert key.may(Permission.CHANGE_MEASURING, "U1")
    assert not key.may(Permission.READ, "U2")
    assert key.may(Permission.READ)
    assert not key.may(Permission.CHANGE_MEASURING)
    assert not key.may(Permission.CHANGE_ACCESS, "U1")


def test_actions_of_a_key_are_not_taken_for_those_of_an_account_of_its_name() -> None:
    names = {Identity("anna", Role.VIEWER, means).actor for means in Means}
    assert names == {"anna", "key:anna"}
