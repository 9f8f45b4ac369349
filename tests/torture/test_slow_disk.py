"""Every sync takes seconds: what is live is not held up, it is an alarm, and nothing is lost."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from harness.checker import check
from harness.ledger_daq import ledger_daq
from harness.ledger_plant import LedgerPlant
from harness.service_rig import Api, ServiceRig, until
from harness.watch import Watch

SLOW_US = 2_000_000
FROM_SYNC = 60
"""The first ones make the database."""

NOT_STORED = "plant:store:results_not_stored"
ALARMS = "[alarms]\nstore_failing_after_s = 0.5\n"
STRACE = (
    *("strace", "-D", "-f", "--seccomp-bpf", "-qq", "-o", "/dev/null", "-e", "trace=fdatasync"),
    *("-e", f"inject=fdatasync:delay_enter={SLOW_US}:when={FROM_SYNC}+"),
)

pytestmark = pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed")


@pytest.mark.timeout(900)
@pytest.mark.torture
def test_a_slow_disk_holds_up_nothing_but_itself(
    torture_seed: int,
    tmp_path: Path,
    figure: Callable[[str], None],
) -> None:
    plant, plant_file = LedgerPlant(torture_seed, n_units=1, load=1.0), tmp_path / "plant.toml"
    with (
        ledger_daq(plant, tmp_path) as daq,
        ServiceRig(plant_file, before=STRACE) as rig,
    ):
        plant.write(plant_file, tmp_path / "data", daq.ports, ALARMS)
        began = {unit[0]: n for unit, n in daq.offered().samples.items()}
        rig.start()
        rig.wait_ready()
        watch = Watch(plant, daq.offered)
        watch.begin(rig.url)
        with rig.api() as api:
            until(lambda: _reason_of(api, NOT_STORED))
            reason = _reason_of(api, NOT_STORED)
            pace = [_next_result(api) for _ in range(3)]
        watch.wait_for_result()
        watch.end()
        assert rig.stop() == 0
        offered = daq.offered()
        lives = {u: [began.get(u, 0), offered.samples[u, 1]] for u in plant.units}
        found = check(plant, plant_file, offered, lives, watch)
    figure(f"every sync takes {SLOW_US / 1e6:g} s\n  {found.counts}")
    assert reason == "the store does not answer"
    assert len(set(pace)) == len(pace)
    assert found.wrong == {}
    assert found.n_results > 0


def _reason_of(api: Api, alarm: str) -> str | None:
    found = api.get("/api/v1/alarms")["alarms"]
    return next((a["condition_reason"] for a in found if a["id"] == alarm and a["is_active"]), None)


def _next_result(api: Api) -> str:
    """Time of the first result that is shown from now on."""
    before = _newest(api)
    until(lambda: _newest(api) > before)
    return _newest(api)


def _newest(api: Api) -> str:
    units = api.get("/api/v1/overview")["units"]
    return max(bearing["time"] or "" for unit in units for bearing in unit["bearings"])
