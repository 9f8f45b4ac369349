"""Tables of accounts, sessions, API keys and the set-up token.

A change and its audit entries are written in one transaction and are on the disk when the method
returns.
"""

import json
from dataclasses import dataclass, field, replace
from typing import Any

from service.store.access.audit_entries import AuditAction, Document, acting
from service.store.access.identities import ApiKey, Role, Session
from service.store.audit import AuditChain, AuditedTables, AuditStore
from service.store.database import Connection, Database
from service.store.integrity import Integrity
from service.store.port import StoreError


class AccessRefusedError(Exception):
    """Error raised if a change of an account is not allowed; the message states the reason."""


class UnknownAccountError(AccessRefusedError):
    """Error raised if an account does not exist."""


@dataclass(frozen=True)
class Account:
    """Account of a person.

    Parameters
    ----------
    password_hash
        Argon2id hash in the encoded text form, which includes its parameters.
    password_number
        Version number of the password, incremented at each change.
    must_change
        Whether another person set the password, so that the owner must change it before other use.
    """

    name: str
    role: Role
    password_hash: str = field(repr=False)
    password_number: int
    created_ns: int
    password_ns: int
    must_change: bool = False


def _account_action(
    done: str, name: str, now_ns: int, before: Role | None = None, after: Role | None = None
) -> AuditAction:
    return _action(f"account.{done}", name, now_ns, _role_document(before), _role_document(after))


def _key_action(done: str, id_: str, now_ns: int, made: ApiKey | None = None) -> AuditAction:
    after = None
    if made is not None:
        after = {
            "name": made.name,
            "role": made.role.value,
            "units": list(made.units),
            "expires_ns": made.expires_ns,
        }
    return _action(f"key.{done}", id_, now_ns, None, after)


def _session_action(done: str, name: str, now_ns: int) -> AuditAction:
    """Return the audit entry about a login or logout, by the account itself."""
    return replace(_action(f"session.{done}", name, now_ns, None, None), actor=name)


def _role_document(role: Role | None) -> Document:
    return None if role is None else {"role": role.value}


def _action(
    action: str, object_: str, now_ns: int, before: Document, after: Document
) -> AuditAction:
    who = acting()
    return AuditAction(
        now_ns, who.actor, action, object_, before, after, source=who.source, peer=who.peer
    )


MAX_SESSIONS = 16
"""Maximum number of sessions per account; a further login ends the oldest session."""

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


class AccountStore(AuditedTables):
    """Store of user accounts; its methods raise `StoreError` if the database cannot be used."""

    def add(
        self, name: str, role: Role, password_hash: str, now_ns: int, must_change: bool = False
    ) -> None:
        """Add an account; a repeated call with the same arguments has no effect.

        With `must_change`, the owner must change the password at the first login. Raises
        `AccessRefusedError` if another account has the name.
        """
        with self._writing() as writer:
            found = writer.execute(SELECT_ACCOUNTS, {"name": name}).fetchone()
            if found and tuple(found[:3]) == (name, role.value, password_hash):
                return  # already written by a call whose outcome was unknown: hashes are unique
            if not _insert_account(writer, name, role, password_hash, now_ns, must_change):
                raise AccessRefusedError(f"account {name} already exists; choose another name")
            self._audit.add(writer, [_account_action("added", name, now_ns, after=role)])

    def get(self, name: str) -> Account | None:
        """Return an account; None if the name is unknown."""
        with self._reading() as reader:
            row = reader.execute(SELECT_ACCOUNTS, {"name": name}).fetchone()
        return _account(row) if row else None

    def all(self) -> list[Account]:
        """Return all accounts, ordered by name."""
        with self._reading() as reader:
            return [_account(row) for row in reader.execute(SELECT_ACCOUNTS, {"name": None})]

    def set_role(self, name: str, role: Role, now_ns: int) -> None:
        """Set the role of an account.

        Raises `AccessRefusedError` if no admin would be left or the account is unknown.
        """
        with self._writing() as writer:
            before = _role(writer, name)
            if role is not Role.ADMIN:
                _require_other_admin(writer, name, before)
            writer.execute("UPDATE account SET role = ? WHERE name = ?", (role.value, name))
            self._audit.add(writer, [_account_action("role_set", name, now_ns, before, role)])

    def set_password(
        self, name: str, password_hash: str, now_ns: int, must_change: bool = False
    ) -> None:
        """Set the password of an account and end its sessions.

        With `must_change`, the owner must change the password at the next login. Raises
        `AccessRefusedError` if the account is unknown.
        """
        with self._writing() as writer:
            _role(writer, name)
            writer.execute(
                "UPDATE account SET password_hash = ?, password_number = password_number + 1,"
                " password_ns = ?, must_change = ? WHERE name = ?",
                (password_hash, now_ns, int(must_change), name),
            )
            writer.execute("DELETE FROM session WHERE account = ?", (name,))
            self._audit.add(writer, [_account_action("password_set", name, now_ns)])

    def rehash(self, account: Account, password_hash: str) -> None:
        """Write a new hash of an account's password; no effect if the password has changed."""
        with self._writing() as writer:
            writer.execute(
                "UPDATE account SET password_hash = ? WHERE name = ? AND password_number = ?"
                " AND created_ns = ?",
                (password_hash, account.name, account.password_number, account.created_ns),
            )

    def remove(self, name: str, now_ns: int) -> None:
        """Remove an account and its sessions.

        Raises `AccessRefusedError` if the other accounts would have no admin, or the account is
        unknown.
        """
        with self._writing() as writer:
            role = _role(writer, name)
            if writer.execute(IS_OTHER, (name,)).fetchone()[0]:
                _require_other_admin(writer, name, role)
            writer.execute("DELETE FROM account WHERE name = ?", (name,))
            self._audit.add(writer, [_account_action("removed", name, now_ns, before=role)])


class SessionStore(AuditedTables):
    """Store of login sessions; its methods raise `StoreError` if the database cannot be used."""

    def add(self, session: Session, password_number: int, oldest_ns: int) -> bool:
        """Add a session; return False if the password is no longer version `password_number`.

        Sessions that began before `oldest_ns` are deleted, and the oldest sessions of the account
        beyond `MAX_SESSIONS`.
        """
        name = session.account
        row = (session.digest, session.created_ns, session.seen_ns, name, password_number)
        with self._writing() as writer:
            writer.execute("DELETE FROM session WHERE created_ns < ?", (oldest_ns,))
            is_begun = writer.execute(INSERT_SESSION, row).rowcount == 1
            writer.execute(END_OLDEST, (name, name, MAX_SESSIONS))
            if is_begun:
                self._audit.add(writer, [_session_action("begun", name, session.created_ns)])
        return is_begun

    def get(self, digest: bytes) -> tuple[Session, Account] | None:
        """Return a session and its account; None if the session does not exist."""
        with self._reading() as reader:
            row = reader.execute(SELECT_SESSION, (digest,)).fetchone()
        if row is None:
            return None
        account = _account(row[3:])
        return Session(bytes(row[0]), account.name, row[1], row[2]), account

    def see(self, digest: bytes, now_ns: int) -> None:
        """Set the time of last use of a session; an unknown session is ignored."""
        with self._writing() as writer:
            writer.execute("UPDATE session SET seen_ns = ? WHERE digest = ?", (now_ns, digest))

    def end(self, digest: bytes, logout_ns: int | None = None) -> None:
        """End a session; ending it twice has no effect.

        Parameters
        ----------
        logout_ns
            Time of the logout, which is recorded; None for a session that expired or was replaced.
        """
        end = "DELETE FROM session WHERE digest = ? RETURNING account"
        with self._writing() as writer:
            ended = writer.execute(end, (digest,)).fetchone()
            if ended is not None and logout_ns is not None:
                self._audit.add(writer, [_session_action("ended", ended[0], logout_ns)])

    def end_all(self) -> None:
        """End all sessions of all accounts, without audit entries."""
        with self._writing() as writer:
            writer.execute("DELETE FROM session")


def _insert_account(
    writer: Connection,
    name: str,
    role: Role,
    password_hash: str,
    now_ns: int,
    must_change: bool = False,
) -> bool:
    """Insert an account within an open transaction; return False if the name is taken.

    With `must_change`, the account must change its password at the first login.
    """
    row = (name, role.value, password_hash, now_ns, now_ns, int(must_change))
    insert = "INSERT INTO account VALUES (?, ?, ?, 1, ?, ?, ?) ON CONFLICT (name) DO NOTHING"
    return writer.execute(insert, row).rowcount == 1


def _require_other_admin(writer: Connection, name: str, role: Role) -> None:
    if role is Role.ADMIN and not writer.execute(IS_OTHER_ADMIN, (name,)).fetchone()[0]:
        raise AccessRefusedError(f"{name} is the only admin; make another account admin first")


def _role(writer: Connection, name: str) -> Role:
    row = writer.execute("SELECT role FROM account WHERE name = ?", (name,)).fetchone()
    if row is None:
        raise UnknownAccountError(f"account {name} does not exist; check the name")
    return Role(row[0])


def _account(row: tuple[Any, ...]) -> Account:
    name, role, password_hash, number, created_ns, password_ns, must_change = row
    times = (created_ns, password_ns)
    return Account(name, Role(role), password_hash, number, *times, bool(must_change))


SELECT_KEYS = """
    SELECT id, name, digest, role, units, created_ns, expires_ns, used_ns, revoked_ns FROM api_key
    WHERE CAST(:id AS TEXT) IS NULL OR id = :id ORDER BY created_ns, id
"""
IS_TAKEABLE = """
    SELECT EXISTS (SELECT 1 FROM set_up_token WHERE digest = ? AND expires_ns > ?
        AND NOT EXISTS (SELECT 1 FROM account))
"""


class KeyStore(AuditedTables):
    """Store of API keys; its methods raise `StoreError` if the database cannot be used."""

    def add(self, key: ApiKey) -> None:
        """Add an API key; adding the same key again has no effect."""
        units = json.dumps(key.units)
        made = (key.id, key.name, key.digest, key.role.value, units, key.created_ns, key.expires_ns)
        with self._writing() as writer:
            found = writer.execute(SELECT_KEYS, {"id": key.id}).fetchone()
            if found and _key(found) == key:
                return  # already written by a call whose outcome was unknown
            writer.execute("INSERT INTO api_key VALUES (?, ?, ?, ?, ?, ?, ?, NULL, NULL)", made)
            self._audit.add(writer, [_key_action("created", key.id, key.created_ns, key)])

    def get(self, id_: str) -> ApiKey | None:
        """Return an API key; None if the id is unknown."""
        with self._reading() as reader:
            row = reader.execute(SELECT_KEYS, {"id": id_}).fetchone()
        return _key(row) if row else None

    def all(self) -> list[ApiKey]:
        """Return all API keys, including revoked and expired keys, oldest first."""
        with self._reading() as reader:
            return [_key(row) for row in reader.execute(SELECT_KEYS, {"id": None})]

    def see(self, id_: str, now_ns: int) -> None:
        """Set the time of last use of an API key; an unknown key is ignored."""
        with self._writing() as writer:
            writer.execute("UPDATE api_key SET used_ns = ? WHERE id = ?", (now_ns, id_))

    def revoke(self, id_: str, now_ns: int) -> bool:
        """Revoke an API key permanently; return False if it is unknown or already revoked."""
        revoke = "UPDATE api_key SET revoked_ns = ? WHERE id = ? AND revoked_ns IS NULL"
        with self._writing() as writer:
            is_news = writer.execute(revoke, (now_ns, id_)).rowcount == 1
            if is_news:
                self._audit.add(writer, [_key_action("revoked", id_, now_ns)])
        return is_news


class SetUpStore(AuditedTables):
    """Store of the set-up token, with which the first account is created."""

    def offer(self, digest: bytes, expires_ns: int) -> bool:
        """Store a set-up token instead of the previous token; return False if an account exists."""
        offer = """
            INSERT INTO set_up_token SELECT 1, ?, ? WHERE NOT EXISTS (SELECT 1 FROM account)
            ON CONFLICT (id) DO UPDATE SET
            digest = excluded.digest, expires_ns = excluded.expires_ns
        """
        with self._writing() as writer:
            return writer.execute(offer, (digest, expires_ns)).rowcount == 1

    def holds(self, digest: bytes, now_ns: int) -> bool:
        """Return whether a digest matches the set-up token; False if expired or accounts exist."""
        with self._reading() as reader:
            return bool(reader.execute(IS_TAKEABLE, (digest, now_ns)).fetchone()[0])

    def take(self, digest: bytes, name: str, password_hash: str, now_ns: int) -> bool:
        """Create the first account, an admin, and delete the set-up token.

        Returns False if the token is wrong or expired, or if an account exists.
        """
        with self._writing() as writer:
            if not writer.execute(IS_TAKEABLE, (digest, now_ns)).fetchone()[0]:
                return False
            writer.execute("DELETE FROM set_up_token")
            _insert_account(writer, name, Role.ADMIN, password_hash, now_ns)
            self._audit.add(writer, [_account_action("set_up", name, now_ns, after=Role.ADMIN)])
        return True


class AccessStore:
    """Stores of access data: accounts, sessions, API keys, the set-up token and their audit trail.

    Parameters
    ----------
    database
        Open database; closed with the store.
    chain
        Audit trail of the changes of access data, of logins and of refused requests.
    integrity
        Integrity checks of the database; None for PostgreSQL, which checks its data itself.
    """

    def __init__(
        self, database: Database, chain: AuditChain, integrity: Integrity | None = None
    ) -> None:
        stores = (chain, database.reading)
        self.accounts = AccountStore(*stores)
        self.sessions = SessionStore(*stores)
        self.keys = KeyStore(*stores)
        self.set_up = SetUpStore(*stores)
        self.audit = AuditStore(*stores)
        self.database, self.integrity = database, integrity or Integrity(chain)
        self._rolled_back: tuple[str, ...] = ()

    def accept(self, now_ns: int) -> str | None:
        """Accept the database as the newest copy; return how it differs from the high-water mark.

        The difference is written to the audit trail. The result is None, and nothing is written,
        if there is no difference.

        Raises
        ------
        StoreError
            If the database cannot be written.
        """
        self._rolled_back = tuple(found.detail for found in self.integrity.adopt(now_ns))
        return "; ".join(self._rolled_back) or None

    @property
    def trouble(self) -> str | None:
        """Description of all integrity faults since the start; None without faults."""
        faults = [*self._rolled_back]
        if self.integrity.mark_error:
            faults.append(f"the high-water mark cannot be written: {self.integrity.mark_error}")
        if self.integrity.n_damaged:
            faults.append(f"damaged or missing rows: {self.integrity.n_damaged}")
        try:
            self.integrity.require_file()
        except StoreError as error:
            faults.append(str(error))
        return "; ".join(faults) or None

    def close(self) -> None:
        """Close the database; closing it twice has no effect."""
        self.database.close()


def _key(row: tuple[Any, ...]) -> ApiKey:
    id_, name, digest, role, units, created_ns, expires_ns, used_ns, revoked_ns = row
    times = (created_ns, expires_ns, used_ns, revoked_ns)
    return ApiKey(id_, name, bytes(digest), Role(role), tuple(json.loads(units)), *times)
