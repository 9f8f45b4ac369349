"""Keys, the set-up token, and all of access together."""

import json
from typing import Any

from service.store.access.accounts import SqlAccounts, SqlSessions, insert_account
from service.store.access.deeds import account_deed, key_deed
from service.store.access.keys import ApiKey
from service.store.access.roles import Role
from service.store.audit_chain import AuditChain
from service.store.database import Connect

SELECT_KEYS = """
    SELECT id, name, digest, role, units, created_ns, expires_ns, used_ns, revoked_ns FROM api_key
    WHERE CAST(:id AS TEXT) IS NULL OR id = :id ORDER BY created_ns, id
"""
IS_TAKEABLE = """
    SELECT EXISTS (SELECT 1 FROM set_up_token WHERE digest = ? AND expires_ns > ?
        AND NOT EXISTS (SELECT 1 FROM account))
"""


class SqlKeys:
    """The keys of one database.

    Parameters
    ----------
    write, read, audit
        As for `SqlAccounts`.
    """

    def __init__(self, write: Connect, read: Connect, audit: AuditChain) -> None:
        self._write, self._read, self._audit = write, read, audit

    def add(self, key: ApiKey) -> None:
        """Add a key; called again with the same one, it is nothing."""
        units = json.dumps(key.units)
        made = (key.id, key.name, key.digest, key.role.value, units, key.created_ns, key.expires_ns)
        with self._write() as writer:
            found = writer.execute(SELECT_KEYS, {"id": key.id}).fetchone()
            if found and _key(found) == key:
                return  # by a call whose end nobody could tell
            writer.execute("INSERT INTO api_key VALUES (?, ?, ?, ?, ?, ?, ?, NULL, NULL)", made)
            self._audit.add(writer, [key_deed("created", key.id, key.created_ns, key)])

    def get(self, id_: str) -> ApiKey | None:
        """Read a key; None if there is none with that id."""
        with self._read() as reader:
            row = reader.execute(SELECT_KEYS, {"id": id_}).fetchone()
        return _key(row) if row else None

    def all(self) -> list[ApiKey]:
        """Read every key that ever was, oldest first."""
        with self._read() as reader:
            return [_key(row) for row in reader.execute(SELECT_KEYS, {"id": None})]

    def see(self, id_: str, now_ns: int) -> None:
        """Note that a key was used."""
        with self._write() as writer:
            writer.execute("UPDATE api_key SET used_ns = ? WHERE id = ?", (now_ns, id_))

    def revoke(self, id_: str, now_ns: int) -> bool:
        """Take a key back for ever; whether it was not taken back before."""
        revoke = "UPDATE api_key SET revoked_ns = ? WHERE id = ? AND revoked_ns IS NULL"
        with self._write() as writer:
            is_news = writer.execute(revoke, (now_ns, id_)).rowcount == 1
            if is_news:
                self._audit.add(writer, [key_deed("revoked", id_, now_ns)])
        return is_news


class SqlSetUp:
    """The set-up token of one database.

    Parameters
    ----------
    write, read, audit
        As for `SqlAccounts`.
    """

    def __init__(self, write: Connect, read: Connect, audit: AuditChain) -> None:
        self._write, self._read, self._audit = write, read, audit

    def offer(self, digest: bytes, expires_ns: int) -> bool:
        """Put a token in the place of any before it; not if there is an account."""
        offer = """
            INSERT INTO set_up_token SELECT 1, ?, ? WHERE NOT EXISTS (SELECT 1 FROM account)
            ON CONFLICT (id) DO UPDATE SET
            digest = excluded.digest, expires_ns = excluded.expires_ns
        """
        with self._write() as writer:
            return writer.execute(offer, (digest, expires_ns)).rowcount == 1

    def holds(self, digest: bytes, now_ns: int) -> bool:
        """Whether a token could be taken now."""
        with self._read() as reader:
            return bool(reader.execute(IS_TAKEABLE, (digest, now_ns)).fetchone()[0])

    def take(self, digest: bytes, name: str, password_hash: str, now_ns: int) -> bool:
        """Make the first account, an admin, and use the token up."""
        with self._write() as writer:
            if not writer.execute(IS_TAKEABLE, (digest, now_ns)).fetchone()[0]:
                return False
            writer.execute("DELETE FROM set_up_token")
            insert_account(writer, name, Role.ADMIN, password_hash, now_ns)
            self._audit.add(writer, [account_deed("set_up", name, now_ns, after=Role.ADMIN)])
        return True


class SqlAccess:
    """All that one database says about who may come in.

    Parameters
    ----------
    write, read, audit
        As for `SqlAccounts`.
    """

    def __init__(self, write: Connect, read: Connect, audit: AuditChain) -> None:
        self.accounts = SqlAccounts(write, read, audit)
        self.sessions = SqlSessions(write, read)
        self.keys = SqlKeys(write, read, audit)
        self.set_up = SqlSetUp(write, read, audit)


def _key(row: tuple[Any, ...]) -> ApiKey:
    id_, name, digest, role, units, created_ns, expires_ns, used_ns, revoked_ns = row
    times = (created_ns, expires_ns, used_ns, revoked_ns)
    return ApiKey(id_, name, bytes(digest), Role(role), tuple(json.loads(units)), *times)
