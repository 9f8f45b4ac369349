"""Accounts, their names and passwords, keys of machines, and what the audit trail says."""

import json
from concurrent.futures import ThreadPoolExecutor

import pytest
from argon2 import extract_parameters
from argon2.low_level import Type
from rigs.standing_clock import T0, at

from core.units import DAY_NS
from service.api.auth.authenticator import SET_UP_S
from service.api.auth.passwords import Hashing, PasswordRefusedError, new_password
from service.store.access.audit_entries import Acting, Source, acting_as
from service.store.access.identities import (
    Identity,
    KeyState,
    Means,
    NameRefusedError,
    Role,
    account_name,
    key_id,
    new_key,
)
from service.store.access.tables import AccessRefusedError
from service.store.audit import AuditQuery

S = 1_000_000_000
PASSWORD = "rotor rope gauge"  # noqa: S105


def test_an_account_is_kept_as_it_was_made(doors, access):
    at(doors, T0).add("Berta", Role.VIEWER, PASSWORD)
    at(doors, T0 + S).add("anna", Role.ADMIN, PASSWORD)

    found = access.accounts.all()
    assert [(one.name, one.role, one.created_ns) for one in found] == [
        ("anna", Role.ADMIN, T0 + S),
        ("berta", Role.VIEWER, T0),
    ]
    assert access.accounts.get("anna") == found[0]
    assert access.accounts.get("nobody") is None
    assert found[0].password_hash not in repr(found[0])


def test_an_account_of_a_name_in_use_or_not_accepted_changes_nothing(doors, access):
    doors.add("anna", Role.VIEWER, PASSWORD)
    before = access.accounts.get("anna")
    with pytest.raises(AccessRefusedError, match="account anna already exists"):
        doors.add("ANNA", Role.ADMIN, PASSWORD)
    with pytest.raises(NameRefusedError):
        doors.add("=anna", Role.VIEWER, PASSWORD)
    with pytest.raises(PasswordRefusedError):
        doors.add("berta", Role.VIEWER, "short")
    assert access.accounts.all() == [before]


def test_neither_the_only_admin_nor_one_who_is_not_there_is_changed(doors, access):
    doors.add("anna", Role.ADMIN, PASSWORD)
    doors.add("berta", Role.ENGINEER, PASSWORD)
    told = access.audit.entries(AuditQuery())
    for change in (
        lambda: access.accounts.remove("anna", T0),
        lambda: access.accounts.set_role("anna", Role.ENGINEER, T0),
    ):
        with pytest.raises(AccessRefusedError, match="anna is the only admin"):
            change()
    for change in (
        lambda: access.accounts.remove("nobody", T0),
        lambda: access.accounts.set_role("nobody", Role.VIEWER, T0),
        lambda: doors.set_password("nobody", PASSWORD),
    ):
        with pytest.raises(AccessRefusedError, match="account nobody does not exist"):
            change()
    assert access.audit.entries(AuditQuery()) == told
    access.accounts.set_role("berta", Role.ADMIN, T0)
    access.accounts.remove("anna", T0)
    access.accounts.remove("berta", T0)  # the last of all may go
    assert access.accounts.all() == []


def test_of_two_admins_who_leave_at_once_one_stays(doors, access):
    doors.add("viewer", Role.VIEWER, PASSWORD)

    def leave(name: str) -> bool:
        try:
            access.accounts.remove(name, T0)
        except AccessRefusedError:
            return False
        return True

    for _ in range(5):
        for name in ("anna", "berta"):
            if access.accounts.get(name) is None:
                doors.add(name, Role.ADMIN, PASSWORD)
        with ThreadPoolExecutor(2) as threads:
            assert sorted(threads.map(leave, ("anna", "berta"))) == [False, True]


def test_the_set_up_token_makes_the_first_admin_and_nothing_more(doors, access):
    token = doors.offer_set_up()
    with pytest.raises(PasswordRefusedError):  # that does not use the token up
        doors.set_up(token, "anna", "short")
    assert doors.set_up(token, "anna", PASSWORD)
    assert not doors.set_up(token, "berta", PASSWORD)
    assert doors.log_in("anna", PASSWORD, "::1").identity.role is Role.ADMIN
    access.accounts.remove("anna", T0)
    assert not doors.set_up(token, "berta", PASSWORD)

    unused = doors.offer_set_up()
    doors.add("anna", Role.VIEWER, PASSWORD)
    assert not doors.set_up(unused, "berta", PASSWORD)
    assert doors.offer_set_up() is None


def test_a_set_up_token_is_void_when_it_is_old_or_another_was_drawn(doors):
    first, second = at(doors, T0).offer_set_up(), at(doors, T0).offer_set_up()
    assert first
    assert second
    late_ns = T0 + round(SET_UP_S * S)
    assert not at(doors, T0).set_up(first, "anna", PASSWORD)
    assert not at(doors, late_ns).set_up(second, "anna", PASSWORD)
    assert not at(doors, T0).set_up("", "anna", PASSWORD)
    assert at(doors, late_ns - 1).set_up(second, "anna", PASSWORD)


def test_of_many_who_set_up_at_once_one_is_admin(doors, access):
    token = doors.offer_set_up()
    with ThreadPoolExecutor(8) as threads:
        done = list(threads.map(lambda n: doors.set_up(token, f"user{n}", PASSWORD), range(8)))
    assert (sum(done), len(access.accounts.all())) == (1, 1)


def test_a_key_opens_as_what_it_was_made_for_until_its_day(access, doors):
    key, shown = at(doors, T0).create_key("Historian", Role.VIEWER, ("U1", "U2", "U1"), 30)

    assert at(doors, T0 + S).machine(shown) == Identity(
        "historian", Role.VIEWER, Means.KEY, ("U1", "U2")
    )
    end_ns = T0 + 30 * DAY_NS
    assert isinstance(at(doors, end_ns - 1).machine(shown), Identity)
    assert at(doors, end_ns).machine(shown) is None
    assert access.keys.get(key.id) != key  # its use is noted
    assert shown not in repr(access.keys.all())


def test_a_key_with_a_wrong_end_opens_nothing_and_counts_as_unknown(access, doors):
    key, shown = doors.create_key("historian", Role.VIEWER, (), 30)
    other_id, other = new_key()
    forged = other.replace(other_id, key.id, 1)
    assert key_id(forged) == key_id(shown) == key.id
    for nothing in ("", "pw_", "pw__", shown + "\n", key.id, "pw_" + "0" * 12 + "_"):
        assert key_id(nothing) is None
    for wrong in (forged, shown[:-1], shown + "A", shown.upper(), f" {shown}", shown.swapcase()):
        assert doors.machine(wrong) is None
    (stored,) = access.keys.all()
    assert stored.used_ns is None


def test_the_last_use_of_a_key_is_written_once_a_minute(access, doors):
    key, shown = at(doors, T0).create_key("historian", Role.VIEWER, (), 30)
    seen = set()
    for second in range(150):
        at(doors, T0 + second * S).machine(shown)
        stored = access.keys.get(key.id)
        assert stored is not None
        seen.add(stored.used_ns)
    assert seen == {T0, T0 + 60 * S, T0 + 120 * S}


def test_no_key_is_made_for_ever_or_for_an_admin_of_one_unit(doors):
    for days in (0, 3651):
        with pytest.raises(AccessRefusedError, match="1 to 3650 days"):
            doors.create_key("historian", Role.VIEWER, (), days)
    with pytest.raises(AccessRefusedError, match="role admin"):
        doors.create_key("historian", Role.ADMIN, ("U1",), 30)


def test_a_revoked_key_opens_nothing_and_no_database_restores_it(access, doors, store_place):
    key, shown = at(doors, T0).create_key("historian", Role.VIEWER, (), 30)
    assert access.keys.revoke(key.id, T0 + S)
    assert not access.keys.revoke(key.id, T0 + 2 * S)
    assert at(doors, T0 + S).machine(shown) is None
    (stored,) = access.keys.all()
    assert (stored.revoked_ns, stored.state(T0 + 99 * DAY_NS)) == (T0 + S, KeyState.REVOKED)
    for statement, words in (
        ("UPDATE api_key SET revoked_ns = NULL", "stays revoked"),
        ("UPDATE api_key SET expires_ns = expires_ns + 1", "kept as they were made"),
        ("UPDATE api_key SET role = 'admin'", "kept as they were made"),
        ("DELETE FROM api_key", "revoked, not forgotten"),
        ("INSERT INTO account VALUES ('x', 'root', '', 1, 0, 0, 0)", "(?i)check constraint"),
    ):
        with pytest.raises(Exception, match=words):
            store_place.execute(statement)


def test_every_change_is_in_the_audit_trail_with_what_was_before_and_nothing_secret(access, doors):
    accounts = access.accounts
    token = at(doors, T0).offer_set_up()
    with acting_as(Acting(Source.COMMAND_LINE, "anna on host", "anna")):
        at(doors, T0).set_up(token, "anna", PASSWORD)
        at(doors, T0 + 1).add("berta", Role.VIEWER, PASSWORD)
        accounts.set_role("berta", Role.ENGINEER, T0 + 2)
        at(doors, T0 + 3).set_password("berta", "another rope gauge")
        accounts.remove("berta", T0 + 4)
        key, shown = at(doors, T0 + 5).create_key("historian", Role.VIEWER, ("U1",), 1)
        access.keys.revoke(key.id, T0 + 6)
        access.keys.revoke(key.id, T0 + 7)  # changes nothing

    entries = [
        entry
        for entry in reversed(access.audit.entries(AuditQuery()))
        if entry.action.startswith(("account.", "key."))
    ]
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


def test_what_is_in_force_is_the_second_recommendation_of_rfc_9106():
    found = extract_parameters(Hashing().hash(PASSWORD))
    assert (found.type, found.version) == (Type.ID, 19)
    assert (found.time_cost, found.memory_cost, found.parallelism) == (3, 65_536, 4)
    assert (found.salt_len, found.hash_len) == (16, 32)


@pytest.mark.parametrize(
    ("password", "said"),
    [
        ("eleven char", "got 11"),
        ("x" * 257, "got 257"),
        ("ababababababab", "different characters"),
        ("aAaAbBbBcCcCdD", "different characters"),
        ("Operator of unit 3", "name of the account"),
        ("", "got 0"),
    ],
)
def test_a_poor_password_is_refused_and_not_repeated(password, said):
    with pytest.raises(PasswordRefusedError, match=said) as refused:
        new_password(password, "operator")
    assert not password or password not in str(refused.value)


def test_a_password_is_hashed_with_its_own_salt_however_its_letters_are_written(hashing):
    one, other = hashing.hash(PASSWORD), hashing.hash(PASSWORD)
    assert one != other
    assert one.startswith("$argon2id$")
    assert hashing.verify(one, PASSWORD)
    assert not hashing.verify(one, PASSWORD + "s")
    composed, decomposed = "kalibrierschlüssel", "kalibrierschlu\u0308ssel"
    assert composed != decomposed
    assert hashing.verify(hashing.hash(composed), decomposed)
    long = "u\u0308" * 150 + "kalibr"  # of 306 code points, which are 156 characters
    assert hashing.verify(hashing.hash(new_password(long, "anna")), long)


def test_nothing_opens_an_account_that_is_not_there_or_whose_hash_is_damaged(hashing):
    for password in ("", "\ud800", "x" * 1_000_000, "\0", "no account has this password"):
        assert not hashing.verify(None, password)
    for stored in ("", "!", "$argon2id$", "$argon2id$v=19$m=8,t=1,p=1$AAAA$AAAA"):
        assert not hashing.verify(stored, PASSWORD)


@pytest.mark.parametrize("name", ["anna", "a", "anna.b-c_d@plant", "7", "a" * 64])
def test_a_usual_name_is_accepted(name):
    assert account_name(f" {name.upper()} ") == name


@pytest.mark.parametrize(
    "name", ["", " ", ".a", "a.", "a b", "a\nb", "a\0b", "ä", "=cmd()", "<b>", "a" * 65, "key:x"]
)
def test_a_name_that_could_mean_something_else_is_refused(name):
    with pytest.raises(NameRefusedError, match="1 to 64"):
        account_name(name)
