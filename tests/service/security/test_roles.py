"""What each role may do, and at which addresses the service starts."""

import pytest

from service.security.addresses import Doorway, why_closed
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


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "::1", "localhost"])
def test_loopback_needs_no_login(host: str) -> None:
    assert why_closed(Doorway(host)) is None
    # a Unix socket is left to the proxy that opens it
    assert why_closed(Doorway("0.0.0.0", is_unix_socket=True)) is None  # noqa: S104


@pytest.mark.parametrize(
    "host",
    ["0.0.0.0", "::", "10.0.0.5", "plant.example", "127.0.0.1.example", "", "::ffff:10.0.0.5"],  # noqa: S104
)
def test_other_addresses_need_tls_and_an_account(host: str) -> None:
    assert why_closed(Doorway(host, has_tls=True, has_account=True)) is None
    for has_tls, has_account in ((False, False), (False, True), (True, False)):
        why = why_closed(Doorway(host, has_tls=has_tls, has_account=has_account))
        assert why is not None
        assert ("[service.tls]" in why, "users add" in why) == (not has_tls, not has_account)
        assert host in why
        assert "\n" not in why
