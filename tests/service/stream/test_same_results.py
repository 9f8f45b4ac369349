"""Acquire and analyse apart find what a single process finds, to the last bit, kills or not."""

from pathlib import Path

import pytest
from harness import stream_rig
from harness.nats_server import NatsServer
from harness.service_rig import ServiceRig, until
from harness.stream_rig import (
    LEDGER,
    blocks,
    found_in,
    on_the_stream,
    positions,
    single_process,
    written_plant,
)

from service.settings.loading import load_plant_file
from service.settings.plant import PlantFile

SEED = 3
N_BLOCKS = 120


async def publish(plant: PlantFile, first: int, last: int) -> None:
    """Publish a stretch of every unit's blocks."""
    pairs = zip(*(blocks(plant, u, N_BLOCKS, SEED) for u in LEDGER.units), strict=True)
    sent = (block for pair in pairs for block in pair)
    await stream_rig.publish(plant, (b for b in sent if first <= number_of(b.start_ns) < last))


def number_of(start_ns: int) -> int:
    return round((start_ns - 1_767_225_600_000_000_000) / 1e9)


async def test_results_are_those_of_a_single_process_through_kills_of_the_analysis_and_of_nats(
    tmp_path: Path, server: NatsServer
) -> None:
    plant_file = written_plant(tmp_path, server)
    plant = load_plant_file(plant_file)
    database = tmp_path / "plant" / "padwatch.sqlite3"
    with ServiceRig(plant_file, role=("analyse",), log="analyse.log") as rig:
        rig.start()
        await publish(plant, 0, 66)
        until(lambda: min(positions(database).values(), default=0) > 50)
        server.kill()
        rig.kill()
        server.start()
        await publish(plant, 66, N_BLOCKS)
        rig.start()
        last = 2 * N_BLOCKS
        until(lambda: max(positions(database).values(), default=0) == last)
        until(lambda: min(positions(database).values(), default=0) >= last - 1)
        assert rig.stop() == 0, rig.newest_log()
    sent = await on_the_stream(plant, server)
    assert len(sent) == last
    wanted = found_in(await single_process(written_plant(tmp_path, server, "single"), sent))
    found = found_in(database)
    assert {name: len(rows) for name, rows in found.items()} == {
        name: len(rows) for name, rows in wanted.items()
    }
    assert found == wanted
    assert len(wanted["assessment"]) > 30
    assert len(wanted["alarm_event"]) > 5
    assert wanted["gap"]


pytestmark = pytest.mark.timeout(300)
