"""Bugs that are planted in the running service: each must be found out by what is left of it."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from harness.kill_cycles import Cycles, kill_cycles
from harness.ledger_daq import LedgerDaq, ledger_daq
from harness.ledger_plant import LedgerPlant
from harness.service_rig import ServiceRig

N_CYCLES = 4
LIFE_S = 8.0
LEAST_S = 8.0
"""Long enough for ten results: a bug in every seventh shows."""

SILENT_S = 12.0
SHOWN_S = 4.0
"""Until there are results: before that nothing can be missing, joined or stale."""

N_LOST_SLOTS = 3


@pytest.fixture
def plant(torture_seed: int) -> LedgerPlant:
    """One unit is enough to find a bug."""
    return LedgerPlant(seed=torture_seed, n_units=1)


@pytest.fixture
def daq(plant: LedgerPlant, tmp_path: Path) -> Iterator[LedgerDaq]:
    """A DAQ that goes on offering samples whatever happens to the service."""
    with ledger_daq(plant, tmp_path) as running:
        yield running


def _planted(bug: str, kind: str) -> object:
    return pytest.param(bug, kind, marks=pytest.mark.planted(bug), id=bug)


@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    ("bug", "kind"),
    [
        _planted("alarms_forgotten_at_start", "alarms"),
        _planted("outage_not_recorded", "gaps"),
        _planted("gap_not_recorded", "gaps"),
        _planted("gap_closed_up", "altered"),
        _planted("stale_shown_as_current", "silent"),
        _planted("promised_before_commit", "lost"),
        _planted("finding_dropped", "missing"),
        _planted("value_altered", "altered"),
        _planted("letter_forgotten", "alarms"),
    ],
)
@pytest.mark.torture
def test_a_bug_in_the_service_is_found_out(
    plant: LedgerPlant,
    daq: LedgerDaq,
    tmp_path: Path,
    torture_seed: int,
    bug: str,
    kind: str,
) -> None:
    plant_file = plant.write(tmp_path / "plant.toml", tmp_path / "data", daq.ports)

    def trouble(number: int) -> None:
        time.sleep(SHOWN_S)
        if number % 4 == 2:
            daq.tell(f"U1 drop {N_LOST_SLOTS}")
        elif number % 4 == 3 and bug == "stale_shown_as_current":
            silence(daq)

    with ServiceRig(plant_file, "harness.planted_service", environment={"PLANTED": bug}) as rig:
        rng = np.random.default_rng(torture_seed)
        done = kill_cycles(plant, daq, rig, plant_file, N_CYCLES, rng, LIFE_S, trouble, LEAST_S)
    assert kind in found_kinds(done), done


def silence(daq: LedgerDaq) -> None:
    """Let the DAQ not answer for a while; the client goes on looking."""
    daq.stop_answering()
    time.sleep(SILENT_S)
    daq.answer_again()


def found_kinds(done: Cycles) -> set[str]:
    """What was found wrong."""
    kinds = set(done.findings.wrong)
    if done.silent_healthy_s:
        kinds.add("silent")
    if done.alarms:
        kinds.add("alarms")
    return kinds
