"""Acquire and analyse over JetStream, killed with NATS at random: results of a single process."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from harness.ledger_daq import ledger_daq
from harness.ledger_plant import LedgerPlant
from harness.nats_server import nats_server, nats_server_command
from harness.service_rig import ServiceRig
from harness.stream_kills import kill_them
from harness.stream_rig import found_in, on_the_stream, positions, single_process

from service.settings.loading import load_plant_file

N_KILLS = 150

PLANT = LedgerPlant(n_units=2, load=1.0, segment_samples=2048, n_segments=2)


@pytest.mark.timeout(3600)
@pytest.mark.torture
def test_results_after_kills_of_acquire_analyse_and_nats_are_those_of_a_single_process(
    tmp_path: Path,
    torture_seed: int,
    figure: Callable[[str], None],
) -> None:
    if nats_server_command() is None:
        pytest.skip("needs nats-server")
    rng = np.random.default_rng(torture_seed)
    with nats_server(tmp_path / "nats") as server, ledger_daq(PLANT, tmp_path) as daq:
        stream = f'[stream]\nservers = ["{server.url}"]\nmax_gb = 2.0\n'
        files = {
            name: PLANT.write(tmp_path / f"{name}.toml", tmp_path / name, daq.ports, stream)
            for name in ("plant", "single")
        }
        database = tmp_path / "plant" / "padwatch.sqlite3"
        acquire = ServiceRig(files["plant"], role=("acquire",), log="acquire.log")
        analyse = ServiceRig(files["plant"], role=("analyse",), log="analyse.log")
        with acquire, analyse:
            done = kill_them(acquire, analyse, server, database, N_KILLS, rng)
        sent = asyncio.run(on_the_stream(load_plant_file(files["plant"]), server))
        reached = sum(unit_last(sent, unit) for unit in PLANT.units)
        assert sum(positions(database).values()) == reached, analyse.newest_log()
        wanted = found_in(asyncio.run(single_process(files["single"], sent)))
    found = found_in(database)
    assert {name: len(rows) for name, rows in found.items()} == {
        name: len(rows) for name, rows in wanted.items()
    }
    assert found == wanted
    killed = ", ".join(f"{n} of {name}" for name, n in sorted(done.killed.items()))
    figure(
        f"kills over a stream ({killed}): {len(sent)} messages, {len(wanted['assessment'])} results"
        " equal to a single process"
    )


def unit_last(sent: list[tuple[str, object]], unit: str) -> int:
    """Sequence of a unit's last message, counted from 1."""
    return max((number for number, (its, _) in enumerate(sent, 1) if its == unit), default=0)
