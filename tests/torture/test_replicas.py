"""Any process of a plant over PostgreSQL is killed, or the database restarted: nothing is lost."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from harness.checker import check
from harness.ledger_daq import LedgerDaq
from harness.ledger_plant import LedgerPlant
from harness.nats_server import nats_cluster, nats_server_command
from harness.postgres_server import PostgresServer, why_not
from harness.replicas import Replicas, chain, chance, replicas
from harness.service_rig import until
from harness.summary import Torture
from harness.watch import silent_healthy_s

N_ROUNDS, N_KILLS = 5, 10
"""Fifty of each kind, looked at after every ten: what is wrong is found where it happened."""

LIFE_S, LONGEST_S = 2.0, 8.0

pytestmark = [
    pytest.mark.torture,  # programs and servers that are started again so often
    pytest.mark.skipif(why_not() is not None, reason=str(why_not())),
]


@pytest.fixture(params=range(N_ROUNDS), ids=lambda number: f"round{number + 1}")
def seed(request: pytest.FixtureRequest, torture_seed: int) -> int:
    """Another one for each round."""
    return torture_seed + int(request.param)


@pytest.fixture
def plant(seed: int) -> LedgerPlant:
    """Two units with twelve channels at twice 600 Hz, and a result every 0.75 s."""
    return LedgerPlant(seed=seed, load=2.0)


@pytest.fixture
def whole(plant: LedgerPlant, daq: LedgerDaq, tmp_path: Path) -> Iterator[Replicas]:
    """The whole chain: it takes six programs and three servers of a stream."""
    if nats_server_command() is None:
        pytest.skip("needs nats-server")
    with (
        PostgresServer() as postgres,
        nats_cluster(tmp_path / "nats") as nodes,
        chain(plant, tmp_path, daq, postgres, nodes) as found,
    ):
        yield found


@pytest.fixture
def running(plant: LedgerPlant, daq: LedgerDaq, tmp_path: Path) -> Iterator[Replicas]:
    with PostgresServer() as postgres, replicas(plant, tmp_path, daq, postgres) as found:
        yield found


@pytest.mark.timeout(3600)
def test_whatever_is_killed_beside_a_single_process_nothing_is_lost(
    running: Replicas, seed: int, torture: Torture
) -> None:
    does = {role: partial(running.kill, role) for role in ("run", "serve")}
    does["postgres"] = running.restart_postgres
    kill_in_turn(running, does, seed, torture.figure)


@pytest.mark.timeout(3600)
def test_whatever_is_killed_of_the_whole_chain_nothing_is_lost(
    whole: Replicas, seed: int, torture: Torture
) -> None:
    does = {role: partial(whole.kill, role) for role in ("acquire", "analyse", "serve")}
    does |= {"node": whole.kill_node, "postgres": whole.restart_postgres}
    kill_in_turn(whole, does, seed, torture.figure)


def kill_in_turn(
    running: Replicas,
    does: Mapping[str, Callable[[int], None]],
    seed: int,
    figure: Callable[[str], None],
) -> None:
    """Kill each kind so often, at random moments; then look at all that is left."""
    rng = np.random.default_rng(seed)
    running.start()
    order = rng.permutation(list(does) * N_KILLS).tolist()
    for number, kind in enumerate(order):
        running.wait_for_result()
        running.act(number)
        chance(rng, LIFE_S, LONGEST_S)
        does[kind](number)
        print(f"{number + 1} of {len(order)}: {kind}", flush=True)
    for rig in running.serving:
        with rig.api() as api:
            until(lambda api=api: api.get("/readyz"))
    running.wait_for_result()
    running.act(len(order))
    running.stop()

    watch, offered = running.whole_watch(), running.daq.offered()
    found = check(running.plant, running.plant_file, offered, running.lives, watch)
    silent_s = sum(silent_healthy_s(running.plant, offered, w.looks) for w in running.watches)
    rows = "".join(f"\n  {name:<32}{value}" for name, value in found.counts.items())
    figure(
        f"killed or restarted, {N_KILLS} times each: {', '.join(does)}{rows}"
        f"\n  promised to operators           {len(watch.promised)}"
        f"\n  answers to clients              {watch.n_answers}"
        f"\n  silent-healthy seconds          {silent_s:.3f}"
    )
    assert found.wrong == {}
    assert silent_s == 0.0
    assert found.n_results > 0
    assert found.n_shown > 0
    assert watch.promised
