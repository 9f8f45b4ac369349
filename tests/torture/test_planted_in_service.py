"""Bugs that are planted in the running service: each must be found out by what is left of it."""

import time

import numpy as np
import pytest
from harness.bench import Bench
from harness.kill_cycles import kill_cycles
from harness.ledger_plant import LedgerPlant
from harness.summary import planted

N_CYCLES = 4
LIFE_S = 8.0
"""Long enough for ten results: a bug in every seventh shows."""

SILENT_S = 12.0
SHOWN_S = 4.0
"""Until there are results: before that nothing can be missing, joined or stale."""

N_LOST_SLOTS = 3


@pytest.fixture
def plant(torture_seed: int) -> LedgerPlant:
    """One unit is enough to find a bug."""
    return LedgerPlant(seed=torture_seed, n_units=1)


@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    ("bug", "kind"),
    [
        planted(bug, kind, mark=pytest.mark.torture)
        for bug, kind in (
            ("alarms_forgotten_at_start", "alarms"),
            ("outage_not_recorded", "gaps"),
            ("gap_not_recorded", "gaps"),
            ("gap_closed_up", "altered"),
            ("stale_shown_as_current", "silent"),
            ("promised_before_commit", "lost"),
            ("finding_dropped", "missing"),
            ("value_altered", "altered"),
            ("letter_forgotten", "alarms"),
        )
    ],
)
def test_a_bug_in_the_service_is_found_out(plant, daq, tmp_path, bug, kind, torture):
    def trouble(number: int) -> None:
        time.sleep(SHOWN_S)
        if number % 4 == 2:
            daq.tell(f"U1 drop {N_LOST_SLOTS}")
        elif number % 4 == 3 and bug == "stale_shown_as_current":
            daq.stop_answering()
            time.sleep(SILENT_S)
            daq.answer_again()

    how = {"program": "harness.planted", "environment": {"PLANTED": bug}}
    with Bench(plant, daq, tmp_path, **how) as bench:
        rng = np.random.default_rng(torture.seed)
        done = kill_cycles(bench, N_CYCLES, rng, LIFE_S, trouble, LIFE_S)
    kinds = set(done.findings.wrong)
    kinds |= {"silent"} if done.silent_healthy_s else set()
    kinds |= {"alarms"} if done.alarms else set()
    assert kind in kinds, done
