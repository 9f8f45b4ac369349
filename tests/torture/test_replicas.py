"""Any process of a plant over PostgreSQL is killed, or the database restarted: nothing is lost."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from harness.checker import check
from harness.ledger_daq import LedgerDaq, ledger_daq
from harness.ledger_plant import LedgerPlant
from harness.postgres_server import PostgresServer, why_not
from harness.replicas import Replicas, chance, replicas, until_answered
from harness.watch import silent_healthy_s

N_KILLS = 50
LIFE_S, LONGEST_S = 2.0, 8.0

pytestmark = pytest.mark.skipif(why_not() is not None, reason=str(why_not()))


@pytest.fixture
def plant(torture_seed: int) -> LedgerPlant:
    """Two units with twelve channels at twice 600 Hz, and a result every 0.75 s."""
    return LedgerPlant(seed=torture_seed, load=2.0)


@pytest.fixture
def daq(plant: LedgerPlant, tmp_path: Path) -> Iterator[LedgerDaq]:
    with ledger_daq(plant, tmp_path) as running:
        yield running


@pytest.fixture
def running(plant: LedgerPlant, daq: LedgerDaq, tmp_path: Path) -> Iterator[Replicas]:
    with PostgresServer() as postgres, replicas(plant, tmp_path, daq, postgres) as found:
        yield found


def kills(is_whole: bool, rng: np.random.Generator) -> list[str]:
    """Which is killed, in what order."""
    n = N_KILLS if is_whole else 1
    wanted = [*["analysis"] * n, *["serving"] * n, *["postgres"] * n]
    return [wanted[at] for at in rng.permutation(len(wanted))]


@pytest.mark.timeout(2 * 3600)
def test_whatever_is_killed_nothing_that_was_shown_is_lost(
    running: Replicas,
    torture_seed: int,
    is_whole: bool,
    figure: Callable[[str], None],
) -> None:
    rng = np.random.default_rng(torture_seed)
    does = {
        "analysis": running.kill_analysis,
        "serving": running.kill_serving,
        "postgres": running.restart_postgres,
    }
    running.start()
    order = kills(is_whole, rng)
    for number, kind in enumerate(order):
        running.wait_for_result()
        running.act(number)
        chance(rng, LIFE_S if is_whole else 0.3, LONGEST_S)
        does[kind](number)
    assert all(until_answered(rig, "/readyz") for rig in running.serving)
    running.wait_for_result()
    running.act(len(order))
    running.stop()

    watch = running.whole_watch()
    offered = running.daq.offered()
    running._note_life()
    found = check(running.plant, running.plant_file, offered, running.lives, watch)
    silent_s = sum(silent_healthy_s(running.plant, offered, w.looks) for w in running.watches)
    rows = "".join(f"\n  {name:<32}{value}" for name, value in found.counts.items())
    figure(
        f"kill -9 of analysis or serving, or restart of PostgreSQL: {len(order)} in all{rows}"
        f"\n  promised to operators           {len(watch.promised)}"
        f"\n  silent-healthy seconds          {silent_s:.3f}"
    )
    assert found.wrong == {}
    assert silent_s == 0.0
    assert found.n_results > 0
    assert found.n_shown > 0
    assert watch.promised
