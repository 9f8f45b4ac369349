"""How soon a killed service is ready again, with a database of a gigabyte."""

import sqlite3
import time
from pathlib import Path

import numpy as np
import pytest
from harness.ledger_daq import ledger_daq
from harness.ledger_plant import LedgerPlant
from harness.service_rig import ServiceRig

N_STARTS = 20
GB = 2**30
ROWS = 5000
STEP_NS = 12_000_000_000


def fill(database: Path, n_bytes: int) -> int:
    """Give a database a past: its newest result of each bearing, every 12 s, back in time."""
    connection = sqlite3.connect(database, isolation_level=None)
    newest = connection.execute("SELECT * FROM assessment ORDER BY time_ns DESC LIMIT 1").fetchone()
    series = [row[0] for row in connection.execute("SELECT id FROM series")]
    insert = f"INSERT INTO assessment VALUES ({','.join('?' * len(newest))})"  # noqa: S608
    time_ns, n_rows = newest[1] - 86_400 * 1_000_000_000, 0
    while database.stat().st_size < n_bytes:
        connection.execute("BEGIN")
        for _ in range(ROWS):
            time_ns -= STEP_NS
            connection.executemany(insert, [(one, time_ns, *newest[2:]) for one in series])
        connection.execute("COMMIT")
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        n_rows += ROWS * len(series)
    connection.close()
    return n_rows


@pytest.mark.timeout(3600)
@pytest.mark.torture
def test_a_killed_service_with_a_gigabyte_is_ready_again(tmp_path, torture):
    plant = LedgerPlant(seed=torture.seed, load=1.0)
    ready_s, costs_s = [], []
    with ledger_daq(plant, tmp_path) as daq:
        file = plant.write(tmp_path / "plant.toml", tmp_path / "data", daq.ports)
        with ServiceRig(file) as rig:
            rig.start()
            rig.wait_ready()
            time.sleep(5.0 * plant.refresh_s)
            rig.stop()
            n_rows = fill(tmp_path / "data" / "padwatch.sqlite3", GB)
            for _ in range(N_STARTS):
                rig.start()
                ready_s.append(rig.wait_ready())
                costs_s.append(sum(sum(one.cpu_times()[:2]) for one in rig.processes()))
                with rig.api() as api:
                    assert api.get("/readyz")["status"] == "ok"
                rig.kill()
    p50, p99 = np.quantile(ready_s, (0.5, 0.99))
    torture.figure(
        f"ready after kill -9 with 1 GB ({n_rows} results), {N_STARTS} starts:"
        f" p50 {p50:.2f} s, p99 {p99:.2f} s; CPU time p99 {np.quantile(costs_s, 0.99):.2f} s"
    )
