"""Anything may be wrong with what lies on the disk: nothing wrong is served, and loss is told."""

import shutil
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from harness.corruption import CHANGES, corrupted
from harness.deeds import Build
from harness.everything import Rows, fill, fill_access, served
from rigs.recording import recorded

from acquisition.errors import ConfigError
from acquisition.recordings.reader import open_recording
from acquisition.recordings.writer import RecordingWriter
from service.store.access.tables import AccessStore
from service.store.port import StoreError
from service.store.sqlite import SqliteStore
from service.store.sqlite.checking import Finding, findings
from service.store.sqlite.store import open_access_file

N_STORES, N_RECORDINGS = 1600, 5000
N_DEEDS = 60
DATABASE, ACCESS = "padwatch.sqlite3", "access.sqlite3"
TARGETS = (
    DATABASE,
    DATABASE,
    DATABASE,
    DATABASE + "-wal",
    DATABASE + "-wal",
    "padwatch.high-water-mark",
    "padwatch.audit-head.json",
    ACCESS,
    ACCESS + "-wal",
    "access.high-water-mark",
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, torture_seed: int, assessment: Build) -> Path:
    """A data folder as kill -9 leaves it, with something of every kind in it."""
    folder = tmp_path_factory.mktemp("whole")
    live = folder / "live" / DATABASE
    fill(live, torture_seed, N_DEEDS, assessment)
    fill_access(live.with_name(ACCESS))
    shutil.copytree(live.parent, folder / "data", ignore=shutil.ignore_patterns("*-shm"))
    return folder / "data"


@pytest.fixture(scope="module")
def truth(whole: Path, tmp_path_factory: pytest.TempPathFactory) -> Rows:
    """What is in it."""
    copied = tmp_path_factory.mktemp("truth") / "data"
    shutil.copytree(whole, copied)
    with opened(copied) as stores:
        rows, errors = served(*stores)
        assert not any(store.integrity.n_damaged for store in stores)
    assert not errors
    assert not list(all_findings(copied))
    return rows


@contextmanager
def opened(folder: Path) -> Iterator[tuple[SqliteStore, AccessStore]]:
    """Both files of a data folder, open."""
    with (
        closing(SqliteStore(folder / DATABASE)) as store,
        closing(open_access_file(folder / ACCESS)) as access,
    ):
        yield store, access


def all_findings(folder: Path) -> Iterator[Finding]:
    """What a check of both files finds."""
    return chain.from_iterable(findings(folder / name) for name in (DATABASE, ACCESS))


EMPTY: frozenset[tuple[object, ...]] = frozenset()
"""Of a table whose name is another one now."""


def outcome(folder: Path, truth: Rows) -> tuple[str, set[str]]:
    """What becomes of a damaged folder, and tables of which something wrong is served."""
    with ExitStack() as stack:
        try:
            stores = stack.enter_context(opened(folder))
        except StoreError:
            return "refused", set()
        rows, errors = served(*stores)
        is_told = bool(errors) or any(s.integrity.n_damaged or s.integrity.found for s in stores)
    wrong = {table for table, found in rows.items() if found - truth.get(table, EMPTY)}
    is_missing = any(known - rows.get(table, EMPTY) for table, known in truth.items())
    if not is_missing and not errors:
        return ("told" if is_told else "harmless"), wrong
    if is_told or any(True for _ in all_findings(folder)):
        return "told", wrong
    return "silent", wrong


def damaged(
    whole: Path, folder: Path, rng: np.random.Generator, targets: Sequence[str] = TARGETS
) -> str:
    """A copy of the folder with one file damaged; what was done to it."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(whole, folder)
    target = folder / targets[rng.integers(len(targets))]
    kind = str(rng.choice(sorted(CHANGES)))
    target.write_bytes(corrupted(target.read_bytes(), kind, rng))
    return f"{kind} in {target.name}"


def test_a_damaged_store_serves_no_wrong_value_and_tells_loss(whole, truth, tmp_path, torture):
    rng = np.random.default_rng(torture.seed)
    counted: Counter[str] = Counter()
    for number in range(torture.times(N_STORES)):
        done = damaged(whole, tmp_path / "data", rng)
        became, wrong = outcome(tmp_path / "data", truth)
        assert not wrong, (number, done)
        assert became != "silent", (number, done)
        counted[became] += 1
    print(dict(counted))
    assert counted["told"]
    assert counted["refused"]


@pytest.fixture
def recording(tmp_path: Path, counting_feed: Any, counts_calibration: Any) -> tuple[Path, bytes]:
    """A recording, and all its samples."""
    folder, feed = tmp_path / "whole", counting_feed(3)
    with RecordingWriter(folder, recorded(counts_calibration(3)), "test") as writer:
        for _ in range(40):
            writer.write(feed.advance(50))
    return folder, read(folder)


def read(folder: Path) -> bytes:
    """Everything that a recording hands out."""
    opened = open_recording(folder)
    blocks = [
        f"{b.epoch} {b.first_index} {b.start_ns} {b.side} {b.slow}".encode() + b.counts.tobytes()
        for b in opened.blocks()
    ]
    told = f"{opened.manifest} {opened.summary.n_samples}"
    return told.encode() + b"".join(blocks)


def test_no_wrong_sample_is_read_from_a_damaged_recording(recording, tmp_path, torture):
    whole, content = recording
    rng = np.random.default_rng(torture.seed)
    n_refused = 0
    for _ in range(torture.times(N_RECORDINGS)):
        done = damaged(whole, tmp_path / "run", rng, sorted(file.name for file in whole.iterdir()))
        try:
            assert read(tmp_path / "run") == content, done
        except ConfigError:
            n_refused += 1
    assert n_refused > 0.9 * torture.times(N_RECORDINGS)
