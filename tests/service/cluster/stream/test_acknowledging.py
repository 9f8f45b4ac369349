"""What is acknowledged is stored, and where a unit goes on with it, also through kills."""

import asyncio
import sqlite3
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, closing
from itertools import chain, islice
from pathlib import Path
from typing import Any

import nats
import pytest
from harness import service_rig, stream_rig
from harness.nats_server import NatsServer
from harness.service_rig import ServiceRig
from harness.stream_rig import (
    LEDGER,
    analysing,
    blocks,
    found_in,
    on_the_stream,
    positions,
    single_process,
    written_plant,
)
from nats.aio.msg import Msg
from nats.js.errors import NotFoundError

from service.app.storage import open_store
from service.cluster import consumer as consuming
from service.cluster.session import consumer_name, stream_name, subject
from service.settings.plant import PlantFile, load_plant_file

N_BLOCKS = 60
UNIT = "U1"
WAIT_S = 60.0


async def publish(plant: PlantFile) -> None:
    """Put the unit's blocks on the stream."""
    await stream_rig.publish(plant, blocks(plant, UNIT, N_BLOCKS, 1))


async def until(so: Callable[[], Awaitable[bool]]) -> None:
    async with asyncio.timeout(WAIT_S):
        while not await so():
            await asyncio.sleep(0.02)


class Look:
    """How far a unit's analysis is by the servers' account, and by the database's."""

    def __init__(self, plant: PlantFile, stream: Any, database: Path) -> None:
        self._plant, self._stream, self._database = plant, stream, database

    async def acknowledged(self) -> int:
        return (await self._info())[0]

    async def all_acknowledged(self) -> bool:
        return await self.acknowledged() == N_BLOCKS

    async def many_delivered(self) -> bool:
        return (await self._info())[1] >= N_BLOCKS // 3

    def stored(self) -> int:
        return positions(self._database).get(UNIT, 0)

    async def require_acknowledged_is_stored(self) -> None:
        acknowledged = await self.acknowledged()
        assert acknowledged <= self.stored(), "acknowledged before it was stored"

    async def _info(self) -> tuple[int, int]:
        try:
            found = await self._stream.consumer_info(stream_name(self._plant), consumer_name(UNIT))
        except NotFoundError:
            return 0, 0
        return found.ack_floor.stream_seq, found.delivered.stream_seq


@asynccontextmanager
async def looking(plant: PlantFile, server: NatsServer) -> AsyncIterator[Look]:
    client = await nats.connect(server.url)
    database = Path(plant.service.data_folder) / "padwatch.sqlite3"
    try:
        yield Look(plant, client.jetstream(), database)
    finally:
        await client.close()


@asynccontextmanager
async def busy_database(plant: PlantFile) -> AsyncIterator[None]:
    """Somebody else writes, and goes on writing."""
    blocker = sqlite3.connect(Path(plant.service.data_folder) / "padwatch.sqlite3")
    blocker.execute("BEGIN IMMEDIATE")
    try:
        yield
    finally:
        blocker.close()


async def _is(so: bool) -> bool:
    return so


@pytest.fixture
def plant(tmp_path: Path, server: NatsServer) -> PlantFile:
    return load_plant_file(written_plant(tmp_path, server))


async def test_a_block_is_acknowledged_after_its_results_are_stored(plant, server):
    async with looking(plant, server) as look, analysing(plant):
        await until(lambda: _is(look.stored() == 0))
        async with busy_database(plant):
            await publish(plant)
            await until(look.many_delivered)
            await asyncio.sleep(0.2)  # for who acknowledges at once to be seen doing it
            await look.require_acknowledged_is_stored()
        await until(lambda: _is(look.stored() == N_BLOCKS))
        await until(look.all_acknowledged)


async def test_stored_blocks_delivered_again_are_acknowledged_again(plant, server, monkeypatch):
    ack, lost = Msg.ack, []

    async def lossy(message: Msg) -> None:
        if len(lost) < 5:
            lost.append(message)
        else:
            await ack(message)

    monkeypatch.setattr(Msg, "ack", lossy)
    monkeypatch.setattr(consuming, "ACK_WAIT_S", 1.0)
    await publish(plant)
    async with looking(plant, server) as look, analysing(plant):
        await until(look.all_acknowledged)
    assert len(lost) == 5


async def test_a_message_that_cannot_be_used_is_an_alarm_of_its_unit_that_says_why(plant, server):
    await publish(plant)
    client = await nats.connect(server.url)
    await client.jetstream().publish(subject(plant, UNIT), b"no block of ours")
    await client.close()
    open_store(plant).close()  # so that the database is there before anybody looks
    database = Path(plant.service.data_folder) / "padwatch.sqlite3"

    def alarms() -> list[tuple[str, str]]:
        with closing(sqlite3.connect(database)) as reader:
            raised = "SELECT alarm, reason FROM alarm_event WHERE change = 'raised'"
            return [(alarm, str(reason)) for alarm, reason in reader.execute(raised)]

    async with analysing(plant):
        await until(lambda: _is(any("messages_refused" in alarm for alarm, _ in alarms())))
    (reason,) = (reason for alarm, reason in alarms() if alarm == f"{UNIT}:stream:messages_refused")
    assert reason


async def test_a_unit_is_known_to_have_blocks_that_wait_while_nothing_can_be_stored(plant, server):
    async with looking(plant, server) as look, analysing(plant) as analysis:
        await until(lambda: _is(analysis.stream is not None))
        consumer = analysis.stream
        assert consumer is not None
        async with busy_database(plant):
            await publish(plant)
            await until(lambda: _is(consumer.waiting == {UNIT}))
        await until(lambda: _is(look.stored() == N_BLOCKS))
        assert consumer.waiting == set()


N_PER_UNIT = 120


async def publish_stretch(plant: PlantFile, first: int, last: int) -> None:
    """Publish a stretch of every unit's blocks."""
    pairs = zip(*(blocks(plant, u, N_PER_UNIT, 3) for u in LEDGER.units), strict=True)
    await stream_rig.publish(plant, chain.from_iterable(islice(pairs, first, last)))


async def test_results_are_those_of_a_single_process_through_kills_of_the_analysis_and_of_nats(
    tmp_path, server
):
    plant_file = written_plant(tmp_path, server)
    plant = load_plant_file(plant_file)
    database = tmp_path / "plant" / "padwatch.sqlite3"
    with ServiceRig(plant_file, role=("analyse",), log="analyse.log") as rig:
        rig.start()
        await publish_stretch(plant, 0, 66)
        service_rig.until(lambda: min(positions(database).values(), default=0) > 50)
        server.kill()
        rig.kill()
        server.start()
        await publish_stretch(plant, 66, N_PER_UNIT)
        rig.start()
        last = 2 * N_PER_UNIT
        service_rig.until(lambda: max(positions(database).values(), default=0) == last)
        service_rig.until(lambda: min(positions(database).values(), default=0) >= last - 1)
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
