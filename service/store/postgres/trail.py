"""The audit trail of a PostgreSQL database, without opening the store: nothing is upgraded."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from service.store.audit import Trail
from service.store.postgres.address import PostgresAddress
from service.store.postgres.connection import PostgresConnection
from service.store.postgres.readers import Readers


def server_trail(address: PostgresAddress, head: Path) -> Trail:
    """Trail of a database, which is opened as it is read, and the head that this host has."""
    return Trail(partial(_opened, address), head, is_shared=True)


@contextmanager
def _opened(address: PostgresAddress) -> Iterator[PostgresConnection]:
    readers = Readers(address)
    try:
        with readers.reading() as reader:
            yield reader
    finally:
        readers.close()
