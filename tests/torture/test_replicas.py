"""Any process of a plant over PostgreSQL is killed, or the database restarted: nothing is lost."""

import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import partial

import numpy as np
import pytest
from harness.checker import check
from harness.ledger_plant import LedgerPlant
from harness.nats_server import NatsServer, nats_cluster, nats_server_command
from harness.postgres_server import PostgresServer, why_not
from harness.replicas import Replicas, replicas
from harness.service_rig import until
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


@pytest.fixture(params=["a single process", "the whole chain"])
def running(request, plant, daq, tmp_path) -> Iterator[Replicas]:
    """Processes of a plant; the whole chain takes five and three servers of a stream."""
    with ExitStack() as stack:
        nodes: Sequence[NatsServer] = ()
        if request.param == "the whole chain":
            if nats_server_command() is None:
                pytest.skip("needs nats-server")
            nodes = stack.enter_context(nats_cluster(tmp_path / "nats"))
        postgres = stack.enter_context(PostgresServer())
        yield stack.enter_context(replicas(plant, tmp_path, daq, postgres, nodes))


@pytest.mark.timeout(3600)
def test_whatever_is_killed_nothing_is_lost(running, seed, torture):
    """Kill each kind so often, at random moments; then look at all that is left."""
    does = {role: partial(running.kill, role) for role in running.rigs}
    does["postgres"] = running.restart_postgres
    if running.nodes:
        does["node"] = running.kill_node
    rng = np.random.default_rng(seed)
    running.start()
    order = rng.permutation(list(does) * N_KILLS).tolist()
    for number, kind in enumerate(order):
        running.wait_for_result()
        running.act(number)
        time.sleep(min(rng.exponential(LIFE_S), LONGEST_S))
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
    torture.figure(
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
