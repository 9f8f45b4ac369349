"""What has been taken back since a copy was made: keys that were revoked, accounts removed."""

import sqlite3
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from service.store.access.keys import KeyState
from service.store.access.port import AccessStore


@dataclass(frozen=True)
class AccessBefore:
    """Who and what could come in by the database that a copy takes the place of.

    Parameters
    ----------
    accounts
        Names of its accounts.
    revoked
        Ids of the keys that were revoked in it.
    """

    accounts: frozenset[str]
    revoked: frozenset[str]


@dataclass(frozen=True)
class AccessAfter:
    """Who and what can come in by the copy.

    Parameters
    ----------
    accounts, keys
        Names of accounts, and names of valid keys with their ids.
    returned
        Accounts that the database before did not have: perhaps they were removed.
    revoked
        Ids of keys that were revoked before and have been revoked again.
    """

    accounts: tuple[str, ...]
    keys: tuple[str, ...]
    returned: tuple[str, ...]
    revoked: tuple[str, ...]


def access_before(database: Path) -> AccessBefore | None:
    """Read it; None if there is no database, or none that can be read."""
    uri = f"{database.absolute().as_uri()}?mode=ro"
    try:
        with closing(sqlite3.connect(uri, uri=True)) as reader:
            accounts = reader.execute("SELECT name FROM account").fetchall()
            revoked = reader.execute("SELECT id FROM api_key WHERE revoked_ns IS NOT NULL")
            return AccessBefore(
                frozenset(name for (name,) in accounts), frozenset(id_ for (id_,) in revoked)
            )
    except (sqlite3.Error, UnicodeDecodeError):
        return None


def take_back(access: AccessStore, before: AccessBefore | None, now_ns: int) -> AccessAfter:
    """End all sessions of a copy, and revoke the keys that were revoked since it was made.

    Raises
    ------
    StoreError
        If the copy cannot be written.
    """
    access.sessions.end_all()
    ids = before.revoked if before else frozenset()
    revoked = [key.id for key in access.keys.all() if key.id in ids and key.revoked_ns is None]
    for id_ in revoked:
        access.keys.revoke(id_, now_ns)
    accounts = [account.name for account in access.accounts.all()]
    valid = [key for key in access.keys.all() if key.state(now_ns) is KeyState.VALID]
    return AccessAfter(
        accounts=tuple(accounts),
        keys=tuple(f"{key.name} ({key.id})" for key in valid),
        returned=tuple(name for name in accounts if before and name not in before.accounts),
        revoked=tuple(revoked),
    )
