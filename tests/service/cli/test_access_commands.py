"""`padwatch users` and `padwatch keys`: who may come in, from the host's own terminal."""

import json
import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from acquisition.clock import SystemClock
from service.api.auth.authenticator import Authenticator
from service.cli.commands import app
from service.runtime.process import made_by
from service.store.access.identities import Identity, Role
from service.store.access.tables import AccessStore
from service.store.audit import AuditQuery
from service.store.sqlite.store import open_access_file

PASSWORD = "rotor rope gauge"  # noqa: S105
OTHER_PASSWORD = "another rope gauge"  # noqa: S105
NOW_NS = 1_767_225_600_000_000_000

Padwatch = Callable[..., Result]


@pytest.fixture
def padwatch(plant_path: Path) -> Padwatch:
    """Runs a command on that plant; a password is handed over by a pipe."""

    def run(group: str, command: str, *arguments: str, password: str | bytes = "") -> Result:
        given = [group, command, str(plant_path), *arguments]
        if not password:
            return CliRunner().invoke(app, given)
        here, there = os.pipe()
        os.write(there, password.encode() if isinstance(password, str) else password)
        os.close(there)
        try:
            return CliRunner().invoke(app, [*given, "--password-fd", str(here)])
        finally:
            os.close(here)

    return run


@pytest.fixture
def access(plant_path: Path) -> Iterator[AccessStore]:
    """The plant's accounts, as a running service has them open."""
    with closing(open_access_file(plant_path.parent / "data" / "access.sqlite3")) as opened:
        yield opened


def test_an_account_that_was_added_can_log_in_and_stands_in_the_audit_trail(padwatch, access):
    added = padwatch("users", "add", "Anna", "--role", "admin", password=PASSWORD + "\n")
    assert (added.exit_code, added.stdout) == (0, "anna: added as admin\n")

    newest = access.audit.entries(AuditQuery(limit=1))[0]
    doors = Authenticator(access, SystemClock())
    assert doors.log_in("anna", PASSWORD, "::1").identity.name == "anna"
    said = (newest.action, newest.object, newest.source)
    assert said == ("account.added", "anna", "command_line")
    assert newest.peer == made_by()


def test_accounts_are_listed_without_anything_secret(padwatch, access):
    for name, role in (("anna", Role.ADMIN), ("berta", Role.VIEWER)):
        access.accounts.add(name, role, "$argon2id$", NOW_NS)

    (anna, berta) = json.loads(padwatch("users", "list", "--json").stdout)
    assert (anna["name"], anna["role"]) == ("anna", "admin")
    assert (berta["name"], berta["role"]) == ("berta", "viewer")
    assert set(anna) == {"name", "role", "created", "password_set"}
    lines = padwatch("users", "list").stdout
    assert lines.startswith("anna: admin, since ")
    assert "argon2" not in lines


def test_roles_and_passwords_change_and_accounts_go(padwatch, access):
    for name, role in (("anna", Role.ADMIN), ("berta", Role.VIEWER)):
        access.accounts.add(name, role, "a hash", NOW_NS)
    before = access.accounts.get("berta")

    assert padwatch("users", "role", "Berta", "operator").exit_code == 0
    assert padwatch("users", "password", "berta", password=OTHER_PASSWORD).exit_code == 0
    after = access.accounts.get("berta")
    assert before is not None
    assert after is not None
    assert (after.role, after.password_number) == (Role.OPERATOR, 2)
    assert after.password_hash != before.password_hash
    assert padwatch("users", "remove", "berta").exit_code == 0
    assert [one.name for one in access.accounts.all()] == ["anna"]


@pytest.mark.parametrize(
    ("arguments", "password", "said"),
    [
        (("add", "anna"), PASSWORD, "account anna already exists"),
        (("add", "=anna"), PASSWORD, "a name must have 1 to 64"),
        (("add", "berta"), "short", "a password must have 12 to 256"),
        (("add", "berta"), b"\xff" * 12, "is not UTF-8 text"),
        (("add", "berta"), "x" * 5000, "is longer than 4096 bytes"),
        (("add", "berta"), "", "no terminal for the password prompt; use --password-fd"),
        (("add", "berta", "--password-fd", "999999"), "", "from descriptor 999999"),
        (("add", "berta", "--role", "root"), PASSWORD, "Invalid value"),
        (("role", "anna", "viewer"), "", "anna is the only admin"),
        (("role", "nobody", "viewer"), "", "account nobody does not exist"),
    ],
)
def test_what_cannot_be_done_ends_with_one_sentence_and_changes_nothing(
    padwatch, access, arguments, password, said
):
    access.accounts.add("anna", Role.ADMIN, "a hash", NOW_NS)
    before = access.accounts.all()

    found = padwatch("users", *arguments, password=password)
    assert found.exit_code == 2
    assert said in found.stderr
    assert "Traceback" not in found.stderr
    assert access.accounts.all() == before


def test_a_key_is_shown_once_and_opens_until_it_is_revoked(padwatch, access, plant_path):
    made = padwatch("keys", "create", "historian", "--unit", "U1", "--days", "7")
    key = made.stdout.strip()
    (listed,) = json.loads(padwatch("keys", "list", "--json").stdout)

    assert made.exit_code == 0
    assert key.startswith(f"pw_{listed['id']}_")
    assert (listed["name"], listed["role"], listed["units"]) == ("historian", "viewer", ["U1"])
    assert (listed["state"], listed["used"], listed["revoked"]) == ("valid", None, None)
    with closing(sqlite3.connect(plant_path.parent / "data" / "padwatch.sqlite3")) as connection:
        assert key not in "\n".join(connection.iterdump())

    doors = Authenticator(access, SystemClock())
    assert isinstance(doors.machine(key), Identity)
    said = [padwatch("keys", "revoke", listed["id"]).stdout for _ in range(2)]
    assert said == [f"{listed['id']}: revoked\n", f"{listed['id']}: was already revoked\n"]
    assert doors.machine(key) is None
    assert ", revoked, " in padwatch("keys", "list").stdout


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("create", "historian", "--unit", "U9"), "unknown unit U9; known units: U1, U2"),
        (("create", "historian", "--days", "0"), "Invalid value"),
        (("create", "a b"), "a name must have 1 to 64"),
        (("create", "historian", "--role", "admin", "--unit", "U1"), "cannot have the role admin"),
        (("revoke", "000000000000"), "key 000000000000 does not exist"),
    ],
)
def test_a_key_that_cannot_be_is_not_made(padwatch, arguments, said):
    padwatch("keys", "create", "other")
    found = padwatch("keys", *arguments)
    assert found.exit_code == 2
    assert said in found.stderr
    assert len(json.loads(padwatch("keys", "list", "--json").stdout)) == 1
