"""Where a PostgreSQL database is."""

import os
import socket
from dataclasses import dataclass
from pathlib import Path

from psycopg.conninfo import conninfo_to_dict, make_conninfo

from service.store.port import StoreError

MAX_PASSWORD_BYTES = 4096
DEFAULTS = {
    "connect_timeout": "5",
    "keepalives_idle": "10",
    "keepalives_interval": "5",
    "keepalives_count": "3",
    "tcp_user_timeout": "25000",
}
"""A server that has gone without a word is noticed within half a minute."""


@dataclass(frozen=True)
class PostgresAddress:
    """How to reach a database.

    Parameters
    ----------
    conninfo
        As libpq takes it, without a password.
    password_file
        File that holds nothing but the password, readable by its owner alone; without it libpq
        looks into ``~/.pgpass``, if it needs one.
    """

    conninfo: str
    password_file: Path | None = None

    @property
    def name(self) -> str:
        """What the database is called in messages."""
        parts = conninfo_to_dict(self.conninfo)
        database = parts.get("dbname") or parts.get("user") or "of the user's name"
        host = parts.get("host") or parts.get("service") or "this computer"
        return f"PostgreSQL database {database} at {host}"

    def full(self, purpose: str) -> str:
        """Everything that is needed to connect, the password included: never to be shown."""
        given = conninfo_to_dict(self.conninfo)
        name = f"padwatch {purpose} {os.getpid()}@{socket.gethostname()}"[:63]
        settings = {**DEFAULTS, "application_name": name, **given, "client_encoding": "UTF8"}
        if self.password_file is not None:
            settings["password"] = self._password(self.password_file)
        return make_conninfo(**settings)  # type: ignore[arg-type]

    def _password(self, path: Path) -> str:
        try:
            with path.open("rb") as file:
                mode = os.fstat(file.fileno()).st_mode
                found = file.read(MAX_PASSWORD_BYTES)
        except OSError as error:
            raise StoreError(f"[store] password_file {path}: {error.strerror}") from error
        if mode & 0o077:
            raise StoreError(f"[store] password_file {path} can be read by others: chmod 600 it")
        return found.decode("utf-8", "surrogateescape").rstrip("\r\n")
