"""Killed while old results become coarser: every hour is there as it was, finer or coarser."""

import subprocess
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from harness.deeds import HOP_NS, T0_NS, value
from harness.tape import environment, python
from rigs.rolled_trends import gather_all

from service.store.port import Trend, TrendQuery
from service.store.sqlite import SqliteStore

N_KILLS = 100
N = 1500
HOUR_NS = 3_600_000_000_000
LATER_NS = 1 << 62

DELETE_EVERYTHING = f"""
import sys
from pathlib import Path
from service.store.sqlite import SqliteStore

store = SqliteStore(Path(sys.argv[1]))
print("begun", flush=True)
for series in store.retention.series():
    while store.retention.delete(series, dict(readings_days=0, minutes_days=0), {LATER_NS}):
        pass
print("done", flush=True)
"""


@pytest.fixture(scope="module")
def old_file(tmp_path_factory, torture_seed, assessment) -> bytes:
    """A database with five hours of results, gathered."""
    path = tmp_path_factory.mktemp("old") / "old.sqlite3"
    with closing(SqliteStore(path)) as store:
        store.append(
            [
                assessment(T0_NS + n * HOP_NS, speed_rpm=value(torture_seed, n, "speed"))
                for n in range(N)
            ],
            [],
        )
        gather_all(store)
    return path.read_bytes()


def by_the_hour(store: SqliteStore) -> Trend:
    return store.trend(TrendQuery("U1", "UJB", ("speed_rpm",), T0_NS, T0_NS + 6 * HOUR_NS, 7, 1))


def test_killed_while_deleting_every_hour_says_what_it_said(old_file, tmp_path, torture):
    rng = np.random.default_rng(torture.seed)
    path = tmp_path / "old.sqlite3"
    path.write_bytes(old_file)
    with closing(SqliteStore(path)) as store:
        before = by_the_hour(store)
    n_cut_short = 0
    for _ in range(torture.times(N_KILLS)):
        for left in tmp_path.glob("old.sqlite3*"):
            left.unlink()
        path.write_bytes(old_file)
        n_cut_short += is_cut_short(path, rng.exponential(0.1))
        with closing(SqliteStore(path)) as store:
            require_same(by_the_hour(store), before)
    assert n_cut_short > 0


def is_cut_short(path: Path, after_s: float) -> bool:
    """Begin to delete, and kill it after a while; whether it had not come to its end."""
    program = python("-c", DELETE_EVERYTHING, path)
    process = subprocess.Popen(program, stdout=subprocess.PIPE, env=environment())
    assert process.stdout is not None
    assert process.stdout.readline() == b"begun\n"
    time.sleep(after_s)
    process.kill()
    said = process.stdout.read()
    process.wait()
    process.stdout.close()
    return said == b""


def require_same(found: Trend, before: Trend) -> None:
    ours, theirs = found.series["speed_rpm"], before.series["speed_rpm"]
    assert list(found.time_ns) == list(before.time_ns)
    assert list(ours.count) == list(theirs.count)
    assert list(ours.minimum) == list(theirs.minimum)
    assert list(ours.maximum) == list(theirs.maximum)
    assert list(ours.mean) == pytest.approx(list(theirs.mean), rel=1e-9)
