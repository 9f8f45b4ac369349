"""Every change of who may come in is in the audit trail, and nothing secret is."""

import json

from service.audit.acting import Acting, acting_as
from service.audit.entry import AuditEntry, Source
from service.security.people import People, create_key
from service.security.roles import Role
from service.store.audit_port import AuditQuery
from service.store.sql_store import SqlStore

T0 = 1_767_225_600_000_000_000
PASSWORD = "rotor rope gauge"  # noqa: S105


def told(store: SqlStore) -> list[AuditEntry]:
    """What the trail says of accounts and keys, oldest first."""
    return [
        entry
        for entry in reversed(store.audit.entries(AuditQuery()))
        if entry.action.startswith(("account.", "key."))
    ]


def test_every_change_is_told_with_what_was_before_and_after(
    store: SqlStore, people: People
) -> None:
    accounts = store.access.accounts
    token = people.offer_set_up(T0)
    assert token is not None
    with acting_as(Acting(Source.COMMAND_LINE, "anna on host", "anna")):
        people.set_up(token, "anna", PASSWORD, T0)
        people.add("berta", Role.VIEWER, PASSWORD, T0 + 1)
        accounts.set_role("berta", Role.ENGINEER, T0 + 2)
        people.set_password("berta", "another rope gauge", T0 + 3)
        accounts.remove("berta", T0 + 4)
        key, shown = create_key(store.access, "historian", Role.VIEWER, ("U1",), 1, T0 + 5)
        store.access.keys.revoke(key.id, T0 + 6)
        store.access.keys.revoke(key.id, T0 + 7)  # changes nothing

    entries = told(store)
    assert [(one.action, one.object, one.time_ns - T0) for one in entries] == [
        ("account.set_up", "anna", 0),
        ("account.added", "berta", 1),
        ("account.role_set", "berta", 2),
        ("account.password_set", "berta", 3),
        ("account.removed", "berta", 4),
        ("key.created", key.id, 5),
        ("key.revoked", key.id, 6),
    ]
    assert {(one.actor, one.peer, one.source) for one in entries} == {
        ("anna", "anna on host", "command_line")
    }
    assert (entries[2].before, entries[2].after) == ('{"role":"viewer"}', '{"role":"engineer"}')
    assert json.loads(entries[5].after or "")["units"] == ["U1"]
    for secret in (PASSWORD, shown, token, "argon2"):
        assert secret not in str(entries)
