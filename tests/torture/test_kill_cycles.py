"""The service is killed at random moments under load: nothing that it promised is gone."""

import time
from functools import partial

import numpy as np
import pytest
from harness.bench import Bench
from harness.kill_cycles import kill_cycles
from harness.ledger_daq import LedgerDaq
from harness.ledger_plant import LedgerPlant

N_CYCLES, N_FEW = 200, 1
LOAD = 2.0
SHORT_LIFE_S = 0.7
N_LOST_SLOTS, SILENT_S = 3, 2.0
ACCOUNTED_S = 2 * 3600.0


@pytest.fixture
def plant(torture_seed: int, is_whole: bool) -> LedgerPlant:
    """Units with twelve channels at twice 600 Hz, and a result every 0.75 s."""
    return LedgerPlant(seed=torture_seed, n_units=2 if is_whole else 1, load=LOAD)


@pytest.mark.timeout(ACCOUNTED_S)
def test_a_killed_service_has_kept_what_it_has_shown(plant, daq, tmp_path, torture):
    rng = np.random.default_rng(torture.seed)
    with Bench(plant, daq, tmp_path, period_s=torture.period_s) as bench:
        if torture.is_whole:
            done = kill_cycles(bench, N_CYCLES, rng, trouble=partial(also, daq))
        else:
            done = kill_cycles(bench, N_FEW, rng, SHORT_LIFE_S)
    torture.figure(f"kill -9 of the running service at {LOAD:g} times nominal\n{done.table()}")
    assert done.findings.wrong == {}
    assert done.alarms == []
    assert done.silent_healthy_s == 0.0
    assert done.findings.n_results > 0
    assert done.findings.n_exceedances > 0 or not torture.is_whole
    assert done.findings.n_shown > 0


def also(daq: LedgerDaq, number: int) -> None:
    """Let the link be in trouble, too, when the service is killed."""
    if number % 5 == 2:
        daq.tell(f"U1 drop {N_LOST_SLOTS}")
    if number % 10 == 8:
        daq.stop_answering()
        time.sleep(SILENT_S)
        daq.answer_again()
