"""The serving process is killed at random moments under load: measuring notices nothing."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

import numpy as np
import pytest
from harness.bench import Bench
from harness.kill_cycles import act
from harness.ledger_plant import LedgerPlant
from harness.service_rig import ServiceRig, until
from harness.watch import Watch

N_KILLS, N_FEW = 50, 2
LOAD = 2.0
STEADY_S, MEAN_S = 10.5, 3.0
"""Least and additional mean life: an earlier end is followed by a pause before the next start."""

SHORT_LIFE_S = 0.5
SHELVING = 3
"""Number of an operator's turn that also shelves an alarm, as of `act`."""

OF_THE_PLANT = {"order1_shaft_x", "order1_shaft_y", "channel_not_ok"}


@pytest.fixture
def plant(torture_seed: int, is_whole: bool) -> LedgerPlant:
    """Units with twelve channels: at twice 600 Hz in the whole torture."""
    n_units, load = (2, LOAD) if is_whole else (1, 0.5)  # a ring of 15 s, for a busy machine
    return LedgerPlant(seed=torture_seed, n_units=n_units, load=load)


@contextmanager
def operator(rig: ServiceRig, watch: Watch) -> Iterator[None]:
    """Acknowledge and shelve alarms all the time, whether the service answers or not."""
    is_over = Event()

    def run() -> None:
        number = SHELVING - 1
        with rig.api() as api:
            while not is_over.wait(0.05):
                act(api, number, watch)
                number += SHELVING

    thread = Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()


def back_after_kill_s(rig: ServiceRig) -> float:
    """Kill the serving process; return the seconds until another one shows the overview."""
    killed = until(rig.kill_serving)
    begun_s = time.monotonic()
    with rig.api() as api:
        assert until(lambda: api.get("/api/v1/overview"))["units"]
    back_s = time.monotonic() - begun_s
    assert killed not in [process.pid for process in rig.processes()]
    return back_s


@pytest.mark.timeout(3600)
def test_a_killed_serving_process_costs_no_sample_and_no_command_that_was_answered(
    plant, daq, tmp_path, torture
):
    rng, back_s = np.random.default_rng(torture.seed), []
    with Bench(plant, daq, tmp_path, period_s=torture.period_s) as bench:
        bench.begin()
        bench.watch.wait_for_result()
        with operator(bench.rig, bench.watch):
            for _ in range(N_KILLS if torture.is_whole else N_FEW):
                least_s, mean_s = (STEADY_S, MEAN_S) if torture.is_whole else (0.0, SHORT_LIFE_S)
                time.sleep(least_s + rng.exponential(mean_s))
                back_s.append(back_after_kill_s(bench.rig))
            bench.watch.wait_for_result()
        raised, gaps = set(bench.raised()), bench.gaps()
        n_gap = sum(unit["source"]["n_gap"] for unit in bench.get("units"))
        found, silent_s = bench.end(), bench.silent_healthy_s()
    p50, p99 = np.quantile(back_s, (0.5, 0.99))
    torture.figure(
        f"kill -9 of the serving process at {plant.load:g} times nominal\n"
        f"  {len(back_s)} kills, pages back after p50 {p50:.2f} s, p99 {p99:.2f} s;"
        f" {n_gap} samples in gaps, {silent_s:.3f} silent-healthy seconds\n  {found.counts}"
    )
    assert found.wrong == {}
    assert (gaps, n_gap, found.n_in_gaps) == ([], 0, 0)
    assert raised <= OF_THE_PLANT
    assert silent_s == 0.0
    assert found.n_results > 0
    assert found.n_shown > 0
    assert found.n_promised > 0
