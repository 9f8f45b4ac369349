"""Acquire and analyse over JetStream, killed with NATS at random: results of a single process."""

import asyncio
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from harness.ledger_daq import ledger_daq
from harness.ledger_plant import LedgerPlant
from harness.nats_server import NatsServer, nats_server, nats_server_command
from harness.service_rig import ServiceRig, until
from harness.stream_rig import found_in, on_the_stream, positions, single_process

from service.settings.plant import load_plant_file

N_KILLS = 150

ALIVE_S = 1.5
"""For how long all of them run between two kills, on average."""

VICTIMS = ("acquire", "analyse", "nats")

PLANT = LedgerPlant(n_units=2, load=1.0, segment_samples=2048, n_segments=2)


def kill_them(
    acquire: ServiceRig,
    analyse: ServiceRig,
    server: NatsServer,
    database: Path,
    n_kills: int,
    rng: np.random.Generator,
) -> Counter[str]:
    """Kill one of them at a time, start it again a little later, and see that results go on."""
    killed: Counter[str] = Counter()
    rigs = {"acquire": acquire, "analyse": analyse}
    for rig in rigs.values():
        rig.start()
    for number in range(n_kills):
        victim = VICTIMS[number % len(VICTIMS)]
        time.sleep(min(rng.exponential(ALIVE_S), 4.0 * ALIVE_S))
        thing = rigs.get(victim, server)
        thing.kill()
        killed[victim] += 1
        time.sleep(rng.uniform(0.0, 0.5))
        thing.start()
        if number % 5 == 4:
            before = _reached(database)
            until(lambda before=before: _reached(database) > before)
    acquire.wait_ready()
    before = _reached(database)
    until(lambda: _reached(database) > before + 20)
    acquire.stop()
    _settle(database)
    analyse.stop()
    return killed


def _reached(database: Path) -> int:
    return max(positions(database).values(), default=0)


def _settle(database: Path) -> None:
    """Wait until nothing more comes of what is on the stream."""
    seen, since_s = _reached(database), time.monotonic()
    while time.monotonic() - since_s < 3.0:
        time.sleep(0.2)
        if _reached(database) != seen:
            seen, since_s = _reached(database), time.monotonic()


@pytest.mark.timeout(3600)
@pytest.mark.torture
def test_results_after_kills_of_acquire_analyse_and_nats_are_of_one_process(tmp_path, torture):
    if nats_server_command() is None:
        pytest.skip("needs nats-server")
    rng = np.random.default_rng(torture.seed)
    with nats_server(tmp_path / "nats") as server, ledger_daq(PLANT, tmp_path) as daq:
        stream = f'[stream]\nservers = ["{server.url}"]\nmax_gb = 2.0\nsilent_after_s = 30.0\n'
        files = {
            name: PLANT.write(tmp_path / f"{name}.toml", tmp_path / name, daq.ports, stream)
            for name in ("plant", "single")
        }
        database = tmp_path / "plant" / "padwatch.sqlite3"
        acquire = ServiceRig(files["plant"], role=("acquire",), log="acquire.log")
        analyse = ServiceRig(files["plant"], role=("analyse",), log="analyse.log")
        with acquire, analyse:
            killed = kill_them(acquire, analyse, server, database, N_KILLS, rng)
        sent = asyncio.run(on_the_stream(load_plant_file(files["plant"]), server))
        last = {unit: number for number, (unit, _) in enumerate(sent, 1)}
        assert sum(positions(database).values()) == sum(last.values()), analyse.newest_log()
        wanted = found_in(asyncio.run(single_process(files["single"], sent)))
    found = found_in(database)
    assert {name: len(rows) for name, rows in found.items()} == {
        name: len(rows) for name, rows in wanted.items()
    }
    assert found == wanted
    kills = ", ".join(f"{n} of {name}" for name, n in sorted(killed.items()))
    torture.figure(
        f"kills over a stream ({kills}): {len(sent)} messages, {len(wanted['assessment'])} results"
        " equal to a single process"
    )
