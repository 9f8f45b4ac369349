"""The service is killed while it records all samples: what it called recorded is there."""

import time
from pathlib import Path

import numpy as np
import pytest
from harness.ledger_daq import LedgerDaq
from harness.ledger_plant import LedgerPlant
from harness.recordings_ledger import Recorded, promised, recorded
from harness.service_rig import ServiceRig, until

from service.recordings.folders import remove_incomplete
from service.recordings.segment import join, unjoined

N_CYCLES, N_FEW = 50, 2
SYNC_S = 1.0
RECORDING = f"""
[recording]
samples = "kept"
length_min = 1
sync_s = {SYNC_S}
"""


def killed(
    plant: LedgerPlant, daq: LedgerDaq, rig: ServiceRig, root: Path, n: int, seed: int
) -> Recorded:
    """Let the service live shortly, n times; every tenth time it ends in good order."""
    rng, n_promised = np.random.default_rng(seed), 0
    for number in range(n):
        rig.start()
        rig.wait_ready()
        until(lambda: promised(rig.url))
        time.sleep(rng.uniform(0.0, 2.0 * SYNC_S))
        n_promised += promised(rig.url)
        if number % 10 == 9:
            assert rig.stop() == 0
        else:
            rig.kill()
    for folder in unjoined(root, plant.units):  # what there was no time for at the end
        join(folder)
    remove_incomplete(root, plant.units)
    found = recorded(root, plant, 1, daq.offered())
    if found.n_samples < n_promised:
        found.wrong.append(f"lost: {n_promised} were promised, {found.n_samples} are there")
    return found


def write_plant(plant: LedgerPlant, daq: LedgerDaq, tmp_path: Path) -> Path:
    return plant.write(tmp_path / "plant.toml", tmp_path / "data", daq.ports, extra=RECORDING)


@pytest.mark.timeout(3600)
def test_a_kill_costs_no_recorded_sample_and_every_hole_is_told(plant, daq, tmp_path, torture):
    n_cycles = N_CYCLES if torture.is_whole else N_FEW
    with ServiceRig(write_plant(plant, daq, tmp_path)) as rig:
        root = tmp_path / "data" / "recordings"
        found = killed(plant, daq, rig, root, n_cycles, torture.seed)
    torture.figure(f"kill -9 during continuous recording, {n_cycles} cycles\n{found.table()}")

    assert found.wrong == []
    assert found.n_samples > 0
    assert found.told["not_running"] > 0
