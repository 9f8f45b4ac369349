"""A second server, which tests may stop; and ways that are cut."""

from collections.abc import Iterator
from contextlib import closing
from itertools import count
from pathlib import Path

import pytest
from harness.cutting_proxy import CuttingProxy
from harness.places import PostgresPlace
from harness.postgres_server import PostgresServer

from service.store.postgres import PostgresStore
from service.store.postgres.connection import PostgresAddress

NUMBERS = count()


@pytest.fixture(scope="session")
def own_server(postgres_server: PostgresServer) -> Iterator[PostgresServer]:
    """A server that may be stopped; there is one only where there is the shared one."""
    with PostgresServer(postgres_server, wal_writer_delay="10s") as server:
        yield server


@pytest.fixture
def own_place(own_server: PostgresServer, tmp_path: Path) -> Iterator[PostgresPlace]:
    """An empty database of the server that may be stopped."""
    name = f"padwatch_{next(NUMBERS)}"
    own_server.create(name)
    yield PostgresPlace(own_server, name, tmp_path / "data")
    own_server.drop(name)


@pytest.fixture
def own_store(own_place: PostgresPlace) -> Iterator[PostgresStore]:
    """A store in it."""
    with closing(own_place.open()) as opened:
        yield opened


@pytest.fixture
def postgres_store(postgres_place: PostgresPlace) -> Iterator[PostgresStore]:
    """A store in a database of the shared server."""
    with closing(postgres_place.open()) as opened:
        yield opened


@pytest.fixture
def password_file(tmp_path: Path) -> Path:
    """A file with the password of the server's administrator."""
    path = tmp_path / "password"
    path.touch(mode=0o600)
    path.write_text(PostgresServer.PASSWORD + "\n")
    return path


@pytest.fixture
def proxy(postgres_place: PostgresPlace) -> Iterator[CuttingProxy]:
    """A way to the shared server that can be cut."""
    with CuttingProxy(postgres_place.server.port) as opened:
        yield opened


@pytest.fixture
def cut_store(postgres_place, proxy, password_file) -> Iterator[PostgresStore]:
    """A store over that way."""
    conninfo = f"host=127.0.0.1 port={proxy.port} user=postgres dbname={postgres_place.database}"
    address = PostgresAddress(conninfo, password_file)
    with closing(PostgresStore(address, postgres_place.head)) as store:
        yield store
