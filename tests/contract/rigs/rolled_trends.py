"""Roll-ups are gathered, and trends out of them compared with those out of single readings."""

import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from core.monitor.assessment import Assessment
from rigs.memory_folder import memory_folder
from service.store.port import Trend
from service.store.sqlite import SqliteStore
from service.store.store import Store

LATER_NS = 1 << 62


def gather_all(store: Store, now_ns: int = LATER_NS) -> None:
    """Gather until nothing is due."""
    while due := store.rollups.due(now_ns):
        for series in due:
            store.rollups.gather(series, now_ns)


def plain_and_gathered(results: Sequence[Assessment]) -> dict[str, bytes]:
    """SQLite files that hold these results: ``plain``, and with all roll-ups ``gathered``."""
    with memory_folder() as folder:
        path = folder / "padwatch.sqlite3"
        with closing(SqliteStore(path)) as store:
            store.append(results, [])
        plain = path.read_bytes()
        with closing(SqliteStore(path)) as store:
            gather_all(store)
        return {"plain": plain, "gathered": path.read_bytes()}


def require_same(found: Trend, wanted: Trend, within: float = 1e-12) -> None:
    """Fail unless all is equal, and means are within that share of the largest value."""
    assert found.bucket_ns == wanted.bucket_ns
    assert list(found.time_ns) == list(wanted.time_ns)
    assert set(found.series) == set(wanted.series)
    for name, theirs in wanted.series.items():
        ours = found.series[name]
        assert list(ours.minimum) == list(theirs.minimum), name
        assert list(ours.maximum) == list(theirs.maximum), name
        assert list(ours.count) == list(theirs.count), name
        assert list(ours.worst_level) == list(theirs.worst_level), name
        for mean, low, high, ours_mean in zip(
            theirs.mean, theirs.minimum, theirs.maximum, ours.mean, strict=True
        ):
            if mean is None or low is None or high is None or ours_mean is None:
                assert mean is ours_mean is None, name
            else:
                assert abs(ours_mean - mean) <= within * max(abs(low), abs(high)), name


def n_rows(path: Path, table: str, where: str = "1") -> int:
    """How many rows of a table there are."""
    with closing(sqlite3.connect(path)) as connection:
        found = connection.execute(f"SELECT count(*) FROM {table} WHERE {where}")  # noqa: S608
        return int(found.fetchone()[0])
