"""The disk is full and has room again: nothing promised is lost, and alarms go on meanwhile."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from harness.checker import check
from harness.ledger_daq import LedgerDaq, ledger_daq
from harness.ledger_plant import LedgerPlant
from harness.service_rig import Api, RefusedError, ServiceRig, until
from harness.small_disk import SmallDisk, small_disk
from harness.watch import Watch

N_CYCLES, N_FEW = 20, 1
DISK_MIB = 32.0
RESUMED_WITHIN_S = 5.0
NOT_STORED = "plant:store:results_not_stored"
ALARMS = "[alarms]\nstore_failing_after_s = 0.5\n"


@pytest.fixture
def plant(torture_seed: int) -> LedgerPlant:
    return LedgerPlant(seed=torture_seed, n_units=1, load=1.0)


@pytest.fixture
def daq(plant: LedgerPlant, tmp_path: Path) -> Iterator[LedgerDaq]:
    with ledger_daq(plant, tmp_path) as running:
        yield running


@pytest.mark.timeout(3600)
def test_a_full_disk_costs_nothing_that_was_promised(
    plant: LedgerPlant,
    daq: LedgerDaq,
    tmp_path: Path,
    is_whole: bool,
    figure: Callable[[str], None],
) -> None:
    plant_file = tmp_path / "plant.toml"
    with small_disk(tmp_path / "small", DISK_MIB) as disk, ServiceRig(plant_file) as rig:
        plant.write(plant_file, disk.folder / "data", daq.ports, ALARMS)
        began = {unit[0]: n for unit, n in daq.offered().samples.items()}
        rig.start()
        rig.wait_ready()
        watch = Watch(plant, daq.offered)
        watch.begin(rig.url)
        watch.wait_for_result()
        with rig.api() as api:
            resumed_s = [
                _filled_and_freed(api, disk) for _ in range(N_CYCLES if is_whole else N_FEW)
            ]
        watch.wait_for_result()
        watch.end()
        assert rig.stop() == 0
        offered = daq.offered()
        lives = {unit: [began.get(unit, 0), offered.samples[unit, 1]] for unit in plant.units}
        found = check(plant, plant_file, offered, lives, watch)
    figure(
        f"disk full and freed\n  cycles {len(resumed_s)}, stored again after at most"
        f" {max(resumed_s):.2f} s; {found.counts}"
    )
    assert found.wrong == {}
    assert found.n_results > 0
    assert not is_whole or max(resumed_s) <= RESUMED_WITHIN_S


def _filled_and_freed(api: Api, disk: SmallDisk) -> float:
    """Fill the disk, look at the service, make room; seconds until results are stored again."""
    disk.fill()
    until(lambda: _is_listed(api, NOT_STORED))
    shown = _newest(api)
    until(lambda: _newest(api) > shown)
    with pytest.raises(RefusedError, match="Nothing was done") as refused:
        api.post(
            f"/api/v1/alarms/{NOT_STORED}/comment", {"actor": "Anna", "text": "is somebody there?"}
        )
    assert refused.value.status == 503
    disk.free()
    freed_s = time.monotonic()
    until(lambda: api.get("/readyz")["status"] == "ok")
    resumed_s = time.monotonic() - freed_s
    until(lambda: not _is_listed(api, NOT_STORED))
    return resumed_s


def _is_listed(api: Api, alarm: str) -> bool:
    found = api.get("/api/v1/alarms")["alarms"]
    return any(one["id"] == alarm and one["is_active"] for one in found)


def _newest(api: Api) -> str:
    """Time of the newest result that is shown."""
    units = api.get("/api/v1/overview")["units"]
    return max(bearing["time"] or "" for unit in units for bearing in unit["bearings"])
