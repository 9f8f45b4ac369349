"""Any write or sync fails, once or for ever: transactions are whole or absent, the store lives."""

import shutil
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from harness.deeds import Build, Loss, deed, letters, loss
from harness.enduring import DATABASE, GAVE_UP
from harness.failing_calls import Case, FailingCalls, Outcome, failing_calls, n_calls

from service.store.port import StoreError
from service.store.sqlite import SqliteStore
from service.store.sqlite.store import file_trail

N_DEEDS = 8
FAILURES = (
    ("pwrite64", "EIO"),
    ("pwrite64", "ENOSPC"),
    ("fdatasync", "EIO"),
    ("fsync", "EIO"),
    ("ftruncate", "EIO"),
    ("rename", "EIO"),
)
N_CASES = 300
"""Of the fast run a twenty-fifth of it; of the long one all there are."""

pytestmark = pytest.mark.skipif(shutil.which("strace") is None, reason="needs strace")


@pytest.fixture(scope="module")
def calls(
    tmp_path_factory: pytest.TempPathFactory, torture_seed: int, assessment: Build
) -> Iterator[FailingCalls]:
    """Processes that append the same transactions."""
    deeds = [deed(torture_seed, n, assessment) for n in range(N_DEEDS)]
    with failing_calls(tmp_path_factory.mktemp("calls"), deeds) as running:
        yield running


@pytest.fixture
def empty(tmp_path: Path) -> Path:
    """A folder with a database that is up to date and has nothing in it."""
    folder = tmp_path / "empty"
    (folder / "data").mkdir(parents=True)
    SqliteStore(folder / "data" / DATABASE, address=letters).close()
    return folder


def run_on_copy(calls: FailingCalls, base: Path, *inject: str) -> Outcome:
    """Let a process work in a copy of a folder, which lies beside it."""
    folder = base.with_name("case")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(base, folder)
    return calls.run(folder, *inject)


def all_cases(tape: Path) -> list[Case]:
    """Every call of a run that may fail, in every way."""
    return [
        Case(call, error, number, is_for_ever)
        for call, error in FAILURES
        for number in range(1, n_calls(tape, call) + 1)
        for is_for_ever in (False, True)
    ]


def wrong(folder: Path, outcome: Outcome, seed: int, build: Build) -> Loss | str | None:
    """What is lost, torn or altered when the database is opened again; None if nothing is."""
    path = folder / "data" / DATABASE
    try:
        with closing(SqliteStore(path)) as store:
            found = loss(store, seed, outcome.acknowledged, N_DEEDS - 1, build)
            if found:
                return found
            if store.integrity.found:
                return f"{store.integrity.found}"
    except StoreError as error:
        return None if outcome.acknowledged < 0 else str(error)
    # a trail without any entry has no head until there is one
    is_whole = outcome.acknowledged < 0 or file_trail(path).verify().is_whole
    return None if is_whole else "the audit trail is not whole"


def require_all_or_nothing(
    calls: FailingCalls, base: Path, n: int | None, seed: int, build: Build
) -> str:
    """Let chosen calls fail, n of them or all, each on a copy of a folder; says what was done."""
    folder = base.with_name("case")
    undisturbed = run_on_copy(calls, base)
    assert (undisturbed.exit_code, undisturbed.errors) == (0, ())
    cases = all_cases(folder / "tape")
    rng = np.random.default_rng(seed)
    chosen = range(len(cases)) if n is None else rng.choice(len(cases), n, replace=False).tolist()
    n_failed = 0
    for case in (cases[i] for i in sorted(chosen)):
        outcome = run_on_copy(calls, base, str(case))
        assert outcome.exit_code in ((0, GAVE_UP) if case.is_for_ever else (0,)), (case, outcome)
        assert wrong(folder, outcome, seed, build) is None, (case, outcome)
        n_failed += bool(outcome.errors)
    return (
        f"writes, syncs and changes of files that fail, once and for ever\n  {len(chosen)} of"
        f" {len(cases)}; the store refused {n_failed} times, and lost nothing"
    )


@pytest.mark.timeout(7200)
@pytest.mark.parametrize(
    ("is_new", "n_cases"),
    [pytest.param(False, N_CASES, id="up to date"), pytest.param(True, N_CASES // 2, id="new")],
)
def test_whatever_call_fails_a_transaction_is_whole_or_absent_and_the_store_goes_on(
    calls, empty, assessment, torture, is_new, n_cases
):
    if is_new:
        shutil.rmtree(empty / "data")
    n = None if torture.times(n_cases) == N_CASES else torture.times(n_cases)
    torture.figure(require_all_or_nothing(calls, empty, n, torture.seed, assessment))


def failing_for_ever(calls: FailingCalls, base: Path, call: str = "pwrite64") -> Outcome:
    """Let no call of a kind succeed any more, half way."""
    run_on_copy(calls, base)
    n = n_calls(base.with_name("case") / "tape", call)
    return run_on_copy(calls, base, str(Case(call, "EIO", n // 2, True)))


def test_a_sync_that_fails_for_ever_acknowledges_nothing_more(calls, empty, assessment, torture):
    outcome = failing_for_ever(calls, empty, "fdatasync")

    assert outcome.exit_code == GAVE_UP
    assert 0 <= outcome.acknowledged < N_DEEDS - 1
    assert all("SQLITE_IOERR" in error for error in outcome.errors)
    assert wrong(empty.with_name("case"), outcome, torture.seed, assessment) is None
