"""Two commands that meet a database to be upgraded at the same moment."""

import sqlite3
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from service.store.schema import MIGRATIONS
from service.store.sqlite.migrating import migrate


def test_both_find_the_newest_schema(tmp_path: Path) -> None:
    for round_ in range(20):
        path = tmp_path / f"{round_}.sqlite3"
        with ThreadPoolExecutor(2) as pool:
            versions = list(pool.map(_upgrade, [path, path]))
        assert versions == [len(MIGRATIONS)] * 2, round_


def _upgrade(path: Path) -> int:
    connection = sqlite3.connect(path, timeout=5.0, isolation_level=None)
    try:
        migrate(connection, str(path))
        return int(connection.execute("PRAGMA user_version").fetchone()[0])
    finally:
        connection.close()
