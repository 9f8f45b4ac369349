"""Accounts and their sessions behind the store's interface."""

from typing import Any

from service.store.access.deeds import account_deed
from service.store.access.port import AccessRefusedError, Account
from service.store.access.roles import Role
from service.store.access.sessions import Session
from service.store.audit_chain import AuditChain
from service.store.database import Connect, Connection

MAX_SESSIONS = 16
"""Of one account; the oldest end when there are more."""

SELECT_ACCOUNTS = """
    SELECT name, role, password_hash, password_number, created_ns, password_ns, must_change
    FROM account
    WHERE CAST(:name AS TEXT) IS NULL OR name = :name ORDER BY name
"""
IS_OTHER_ADMIN = "SELECT EXISTS (SELECT 1 FROM account WHERE role = 'admin' AND name <> ?)"
IS_OTHER = "SELECT EXISTS (SELECT 1 FROM account WHERE name <> ?)"
INSERT_SESSION = """
    INSERT INTO session SELECT ?, name, ?, ? FROM account
    WHERE name = ? AND password_number = ?
"""
SELECT_SESSION = """
    SELECT digest, session.created_ns, seen_ns, name, role, password_hash, password_number,
        account.created_ns, password_ns, must_change
    FROM session JOIN account ON account = name WHERE digest = ?
"""
END_OLDEST = """
    DELETE FROM session WHERE account = ? AND digest NOT IN (
        SELECT digest FROM session WHERE account = ? ORDER BY created_ns DESC, digest LIMIT ?)
"""


class SqlAccounts:
    """The accounts of one database.

    Parameters
    ----------
    write, read
        A transaction of the database's one writer, and a short look at it; both raise `StoreError`.
    audit
        Told of each change in its own transaction.
    """

    def __init__(self, write: Connect, read: Connect, audit: AuditChain) -> None:
        self._write, self._read, self._audit = write, read, audit

    def add(
        self, name: str, role: Role, password_hash: str, now_ns: int, must_change: bool = False
    ) -> None:
        """Add an account; refused if there is another one of that name."""
        with self._write() as writer:
            found = writer.execute(SELECT_ACCOUNTS, {"name": name}).fetchone()
            if found and tuple(found[:3]) == (name, role.value, password_hash):
                return  # by a call whose end nobody could tell: no two hashes are alike
            if not insert_account(writer, name, role, password_hash, now_ns, must_change):
                raise AccessRefusedError(f"there is an account {name} already")
            self._audit.add(writer, [account_deed("added", name, now_ns, after=role)])

    def get(self, name: str) -> Account | None:
        """Read an account; None if there is none of that name."""
        with self._read() as reader:
            row = reader.execute(SELECT_ACCOUNTS, {"name": name}).fetchone()
        return _account(row) if row else None

    def all(self) -> list[Account]:
        """Read every account, by name."""
        with self._read() as reader:
            return [_account(row) for row in reader.execute(SELECT_ACCOUNTS, {"name": None})]

    def set_role(self, name: str, role: Role, now_ns: int) -> None:
        """Change a role; refused if no admin would be left."""
        with self._write() as writer:
            before = _role(writer, name)
            if role is not Role.ADMIN:
                _require_other_admin(writer, name, before)
            writer.execute("UPDATE account SET role = ? WHERE name = ?", (role.value, name))
            self._audit.add(writer, [account_deed("role_set", name, now_ns, before, role)])

    def set_password(
        self, name: str, password_hash: str, now_ns: int, must_change: bool = False
    ) -> None:
        """Change a password and end all sessions of the account."""
        with self._write() as writer:
            _role(writer, name)
            writer.execute(
                "UPDATE account SET password_hash = ?, password_number = password_number + 1,"
                " password_ns = ?, must_change = ? WHERE name = ?",
                (password_hash, now_ns, int(must_change), name),
            )
            writer.execute("DELETE FROM session WHERE account = ?", (name,))
            self._audit.add(writer, [account_deed("password_set", name, now_ns)])

    def rehash(self, account: Account, password_hash: str) -> None:
        """Write the same password's new hash, unless the password has changed meanwhile."""
        with self._write() as writer:
            writer.execute(
                "UPDATE account SET password_hash = ? WHERE name = ? AND password_number = ?"
                " AND created_ns = ?",
                (password_hash, account.name, account.password_number, account.created_ns),
            )

    def remove(self, name: str, now_ns: int) -> None:
        """Remove an account with its sessions; refused if others would be left without admin."""
        with self._write() as writer:
            role = _role(writer, name)
            if writer.execute(IS_OTHER, (name,)).fetchone()[0]:
                _require_other_admin(writer, name, role)
            writer.execute("DELETE FROM account WHERE name = ?", (name,))
            self._audit.add(writer, [account_deed("removed", name, now_ns, before=role)])


class SqlSessions:
    """The sessions of one database.

    Parameters
    ----------
    write, read
        As for `SqlAccounts`; logins are told of where they are asked for.
    """

    def __init__(self, write: Connect, read: Connect) -> None:
        self._write, self._read = write, read

    def add(self, session: Session, password_number: int, oldest_ns: int) -> bool:
        """Begin a session, unless the password it was given for is no longer the account's."""
        name = session.account
        row = (session.digest, session.created_ns, session.seen_ns, name, password_number)
        with self._write() as writer:
            writer.execute("DELETE FROM session WHERE created_ns < ?", (oldest_ns,))
            is_begun = writer.execute(INSERT_SESSION, row).rowcount == 1
            writer.execute(END_OLDEST, (name, name, MAX_SESSIONS))
        return is_begun

    def get(self, digest: bytes) -> tuple[Session, Account] | None:
        """Read a session with its account as it is now."""
        with self._read() as reader:
            row = reader.execute(SELECT_SESSION, (digest,)).fetchone()
        if row is None:
            return None
        account = _account(row[3:])
        return Session(bytes(row[0]), account.name, row[1], row[2]), account

    def see(self, digest: bytes, now_ns: int) -> None:
        """Note that a session was used."""
        with self._write() as writer:
            writer.execute("UPDATE session SET seen_ns = ? WHERE digest = ?", (now_ns, digest))

    def end(self, digest: bytes) -> None:
        """End a session; ending it twice is fine."""
        with self._write() as writer:
            writer.execute("DELETE FROM session WHERE digest = ?", (digest,))

    def end_all(self) -> None:
        """End the sessions of all accounts."""
        with self._write() as writer:
            writer.execute("DELETE FROM session")


def insert_account(
    writer: Connection,
    name: str,
    role: Role,
    password_hash: str,
    now_ns: int,
    must_change: bool = False,
) -> bool:
    """Add an account unless there is one of that name; whether it was added."""
    row = (name, role.value, password_hash, now_ns, now_ns, int(must_change))
    insert = "INSERT INTO account VALUES (?, ?, ?, 1, ?, ?, ?) ON CONFLICT (name) DO NOTHING"
    return writer.execute(insert, row).rowcount == 1


def _require_other_admin(writer: Connection, name: str, role: Role) -> None:
    """Refuse what would leave no admin; an account that is no admin may change as it likes."""
    if role is Role.ADMIN and not writer.execute(IS_OTHER_ADMIN, (name,)).fetchone()[0]:
        raise AccessRefusedError(f"{name} is the only admin; make somebody else one first")


def _role(writer: Connection, name: str) -> Role:
    """Role of an account that is about to be changed; refused if there is none such."""
    row = writer.execute("SELECT role FROM account WHERE name = ?", (name,)).fetchone()
    if row is None:
        raise AccessRefusedError(f"there is no account {name}")
    return Role(row[0])


def _account(row: tuple[Any, ...]) -> Account:
    name, role, password_hash, number, created_ns, password_ns, must_change = row
    times = (created_ns, password_ns)
    return Account(name, Role(role), password_hash, number, *times, bool(must_change))
