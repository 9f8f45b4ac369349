"""The power fails at any moment: what was acknowledged is there, whole and unaltered."""

import pickle
import shutil
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from harness.deeds import Build, Loss, deed, loss
from harness.disk import Disk
from harness.tape import Acknowledged, Step, environment, python, record

from service.store.sqlite import SqliteStore
from service.store.sqlite.store import file_trail

N_DEEDS = 150
N_CUTS, N_FEW = 5000, 50
DATABASE = "padwatch.sqlite3"


pytestmark = pytest.mark.skipif(shutil.which("strace") is None, reason="needs strace")


@pytest.fixture
def recorded(tmp_path_factory, torture_seed, assessment) -> list[Step]:
    """What a store asks of its disk while transactions are appended to it."""
    folder = tmp_path_factory.mktemp("tape")
    (folder / "data").mkdir()
    with (folder / "deeds").open("wb") as file:
        pickle.dump([deed(torture_seed, n, assessment) for n in range(N_DEEDS)], file)
    command = python("-m", "harness.enduring", folder / "deeds", folder)
    return record(command, folder / "data", folder / "tape", environment())


def cuts(steps: Sequence[Step], n: int, seed: int) -> Iterator[tuple[int, dict[str, bytes]]]:
    """Number of the newest acknowledged transaction and what is left, for cuts at random places."""
    rng = np.random.default_rng(seed)
    made = next(i for i, step in enumerate(steps) if isinstance(step, Acknowledged))
    places = np.sort(rng.integers(made, len(steps) + 1, n))
    disk = Disk()
    disk.take(steps[: places[0]])
    yield disk.acknowledged, disk.after_a_cut(rng)
    for before, place in pairwise(places):
        disk.take(steps[before:place])
        yield disk.acknowledged, disk.after_a_cut(rng)


def left_in(folder: Path, files: dict[str, bytes]) -> Path:
    """The folder as it is found when the power is back."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return folder / DATABASE


def damage(path: Path) -> list[str]:
    """What SQLite finds wrong with a database."""
    with closing(sqlite3.connect(path)) as database:
        said = [line for (line,) in database.execute("PRAGMA integrity_check(1000000)")]
        # SQLite 3.40 takes the wrong column of strict tables without rowid for empty
        (n_empty,) = database.execute("SELECT count(*) FROM gap WHERE n_samples IS NULL").fetchone()
    wrong = {"ok"} if n_empty else {"ok", "NULL value in gap.n_samples"}
    return [line for line in said if line not in wrong]


@pytest.mark.timeout(3600)
def test_nothing_acknowledged_is_lost_by_a_power_cut(recorded, tmp_path, assessment, torture):
    n_cuts = N_CUTS if torture.is_whole else N_FEW
    for acknowledged, files in cuts(recorded, n_cuts, torture.seed):
        path = left_in(tmp_path / "data", files)
        lost, mark = found_after(path, torture.seed, acknowledged, assessment)
        assert not lost, acknowledged
        assert not mark
        assert damage(path) == []
        assert file_trail(path).verify().is_whole
    torture.figure(f"power cuts: {n_cuts}, 0 acknowledged lost, 0 torn, 0 altered, 0 corrupt")


def found_after(
    path: Path, seed: int, acknowledged: int, build: Build
) -> tuple[Loss, Sequence[object]]:
    """What a store that is opened after a cut has lost, and what its high-water mark tells."""
    with closing(SqliteStore(path)) as store:
        return loss(store, seed, acknowledged, N_DEEDS - 1, build), store.integrity.found
