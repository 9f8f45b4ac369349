"""What each role may do."""

import pytest

from service.security.identity import Identity, Means
from service.security.roles import Permission, Role

MATRIX = {
    Role.VIEWER: {Permission.READ},
    Role.OPERATOR: {Permission.READ, Permission.ACT_ON_ALARMS},
    Role.ENGINEER: set(Permission) - {Permission.CHANGE_ACCESS},
    Role.ADMIN: set(Permission),
}


@pytest.mark.parametrize("role", Role)
def test_a_role_may_what_the_table_of_roles_says(role: Role) -> None:
    assert {permission for permission in Permission if role.may(permission)} == MATRIX[role]


def test_a_key_for_one_unit_opens_no_other_and_changes_nothing_of_the_plant() -> None:
    key = Identity("historian", Role.ENGINEER, Means.KEY, ("U1",))

    assert key.may(Permission.CHANGE_MEASURING, "U1")
    assert not key.may(Permission.READ, "U2")
    assert key.may(Permission.READ)
    assert not key.may(Permission.CHANGE_MEASURING)
    assert not key.may(Permission.CHANGE_ACCESS, "U1")
    # actions of a key are not taken for those of an account of its name
    assert {Identity("anna", Role.VIEWER, means).actor for means in Means} == {"anna", "key:anna"}
