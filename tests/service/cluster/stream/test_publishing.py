import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import nats
import numpy as np
import pytest
from harness.nats_server import NatsServer, nats_server
from harness.waiting import at_work, until
from nats.errors import ConnectionClosedError
from nats.js.client import JetStreamContext
from rigs.blocks import given_block, starting_at

from acquisition.clock import SystemClock
from core.quality import GOOD
from core.samples.blocks import SampleBlock
from service.cluster.frames import Taken, decoded
from service.cluster.publisher import Publisher
from service.cluster.session import (
    StreamError,
    StreamMisfitError,
    identity_of,
    session,
    stream_name,
    subject,
)
from service.live.status import LinkState
from service.measuring.acquirer import LinkNews
from service.settings.plant import PlantFile
from service.settings.processes import StreamSettings

WAIT_S = 30.0


def block(plant: PlantFile, number: int, n_samples: int = 60) -> SampleBlock:
    unit = plant.unit[0]
    samples = np.full((len(unit.channel), n_samples), number, np.float32)
    quality = (GOOD,) * len(unit.channel)
    first = number * n_samples
    return given_block(unit.id, 1, first, first, unit.sampling_hz, samples, quality)


def publisher(plant: PlantFile, url: str, **settings: object) -> Publisher:
    unit = plant.unit[0]
    given = StreamSettings(**{"servers": (url,), "max_gb": 0.1, **settings})  # type: ignore[arg-type]
    return Publisher(plant, given, {unit.id: identity_of(plant, unit)}, SystemClock())


@asynccontextmanager
async def running(publisher: Publisher) -> AsyncIterator[Publisher]:
    async with at_work(publisher.run()):
        yield publisher


async def published(out: Publisher, *blocks: SampleBlock) -> None:
    """Publish blocks; returns when the server has confirmed them."""
    for each in blocks:
        await out.publish(each)
    await drained(out)


async def drained(publisher: Publisher) -> None:
    await asyncio.wait_for(publisher.waiting.drained(), WAIT_S)


@asynccontextmanager
async def looking(server: NatsServer) -> AsyncIterator[JetStreamContext]:
    client = await nats.connect(server.url)
    try:
        yield client.jetstream()
    finally:
        await client.close()


async def kept(plant: PlantFile, server: NatsServer) -> list[SampleBlock | LinkNews]:
    unit = plant.unit[0]
    async with looking(server) as stream:
        state = (await stream.stream_info(stream_name(plant))).state
        found = []
        for sequence in range(state.first_seq, state.last_seq + 1):
            message = await stream.get_msg(stream_name(plant), sequence)
            assert message.subject == subject(plant, unit.id)
            told = decoded(message.data or b"", identity_of(plant, unit))
            found.append(told.block if isinstance(told, Taken) else told)
        return found


def numbers(found: list[SampleBlock | LinkNews]) -> list[int]:
    return [its.first_index // 60 for its in found if isinstance(its, SampleBlock)]


async def test_blocks_and_news_of_a_link_arrive_in_the_order_in_which_they_came(plant, server):
    unit = plant.unit[0].id
    async with running(publisher(plant, server.url)) as out:
        out.publish_link(LinkNews(unit, LinkState.CONNECTED))
        for number in range(5):
            await out.publish(block(plant, number))
        out.publish_link(LinkNews(unit, LinkState.NOT_CONNECTED, "away"))
        out.publish_link(LinkNews(unit, LinkState.NOT_CONNECTED, "away"))
        await drained(out)
    found = await kept(plant, server)
    assert numbers(found) == [0, 1, 2, 3, 4]
    assert found[0] == LinkNews(unit, LinkState.CONNECTED)
    assert found[6:] == [LinkNews(unit, LinkState.NOT_CONNECTED, "away")]


async def test_a_block_that_counts_the_same_samples_at_another_time_is_another_block(plant, server):
    anew = [starting_at(block(plant, n), 10**9 + n) for n in (0, 1)]
    async with running(publisher(plant, server.url)) as out:
        await published(out, block(plant, 0), block(plant, 1), *anew)
    assert numbers(await kept(plant, server)) == [0, 1, 0, 1]


async def test_a_block_that_is_published_twice_is_kept_once(plant, server):
    async with running(publisher(plant, server.url)) as out:
        await published(out, *(block(plant, number) for number in (0, 1, 0, 1, 2)))
        assert out.n_doubles == 2
    async with running(publisher(plant, server.url)) as again:
        await published(again, block(plant, 2))
    assert numbers(await kept(plant, server)) == [0, 1, 2]


async def test_a_server_that_is_killed_costs_no_block(plant, server):
    async with running(publisher(plant, server.url)) as out:
        for number in range(30):
            await out.publish(block(plant, number))
        await until(lambda: out.waiting.n_published >= 10)
        server.kill()
        for number in range(30, 40):
            await out.publish(block(plant, number))
        server.start()
        await drained(out)
        assert out.trouble is None
    assert numbers(await kept(plant, server)) == list(range(40))


async def test_a_full_memory_makes_the_device_wait_and_loses_nothing(plant, server):
    out = publisher(plant, server.url, buffer_mb=1.0)
    put = asyncio.create_task(_publish_all(out, plant, 12))
    while not put.done() and out.waiting.n_waiting < 4:
        await asyncio.sleep(0)
    assert not put.done()
    assert out.waiting.n_bytes <= out.waiting.capacity
    async with running(out):
        await asyncio.wait_for(put, WAIT_S)
        await drained(out)
    assert len(await kept(plant, server)) == 12


async def _publish_all(out: Publisher, plant: PlantFile, n_blocks: int) -> None:
    """Publish blocks of a quarter of a megabyte."""
    for number in range(n_blocks):
        await out.publish(block(plant, number, 60_000 // len(plant.unit[0].channel)))


async def test_a_full_stream_refuses_aloud_and_drops_nothing(plant, server):
    out = publisher(plant, server.url)
    async with running(out):
        await published(out, block(plant, 0))
    tight = publisher(plant, server.url, max_gb=0.001)
    async with running(tight):
        await _publish_all(tight, plant, 8)
        await until(lambda: "is full" in (tight.trouble or ""))
    assert numbers(await kept(plant, server))[0] == 0


def test_news_of_a_link_do_not_pile_up_while_the_servers_are_away(plant):
    out, unit = publisher(plant, "nats://127.0.0.1:9"), plant.unit[0].id
    for second in range(1000):
        out.publish_link(LinkNews(unit, LinkState.NOT_CONNECTED, f"silent for {second} s"))

    queue = out.waiting._waiting[unit]
    assert len(queue) == 2
    assert out.waiting.n_bytes == sum(len(message.payload) for message in queue)
    assert b"999 s" in queue[-1].payload


async def test_without_a_server_it_waits_and_says_so(plant, server):
    server.kill()
    async with running(publisher(plant, server.url)) as out:
        await out.publish(block(plant, 0))
        await until(lambda: "cannot be reached" in (out.trouble or ""))
        server.start()
        await drained(out)


async def test_a_server_without_jetstream_is_named_with_what_to_do(plant, tmp_path):
    bare = NatsServer(tmp_path / "bare", has_jetstream=False)
    bare.start()
    try:
        async with running(publisher(plant, bare.url)) as out:
            await until(lambda: "-js" in (out.trouble or ""))
    finally:
        bare.stop()


async def test_a_stream_of_another_plant_is_left_alone(plant, server):
    shared = plant.model_copy(update={"stream": StreamSettings(name="shared")})
    other = shared.model_copy(
        update={"plant": plant.plant.model_copy(update={"name": "Another plant"})}
    )
    async with running(publisher(shared, server.url)) as out:
        await published(out, block(plant, 0))
    async with running(publisher(other, server.url)) as out:
        await out.publish(block(plant, 1))
        await until(lambda: "belongs to another plant" in (out.trouble or ""))
    assert numbers(await kept(shared, server)) == [0]


async def test_a_server_that_lets_no_one_in_without_a_token_is_named_with_advice(plant, tmp_path):
    token = tmp_path / "token"
    token.write_text("s3cret\n")
    with nats_server(tmp_path / "closed", 'authorization { token: "s3cret" }') as closed:
        async with running(publisher(plant, closed.url)) as out:
            await until(lambda: "token_file" in (out.trouble or ""))
        async with running(publisher(plant, closed.url, token_file=str(token))) as out:
            await published(out, block(plant, 0))


async def fail(error: Exception) -> None:
    raise error


async def use(server: NatsServer, *errors: Exception) -> None:
    """Use a connection in ways that fail, while the server is killed."""
    settings = StreamSettings(servers=(server.url,))
    async with session(settings, "test"), asyncio.TaskGroup() as tasks:
        for error in errors:
            tasks.create_task(fail(error))
        server.kill()
        await asyncio.Event().wait()


async def test_a_connection_that_several_lose_at_once_is_one_trouble(server):
    with pytest.raises(StreamError, match="NATS at"):
        await use(server)
    server.start()
    with pytest.raises(StreamMisfitError, match="the worse one"):
        await use(server, ConnectionClosedError(), StreamMisfitError("the worse one"))


async def test_a_stream_that_is_deleted_meanwhile_is_made_again(plant, server):
    async with running(publisher(plant, server.url)) as publishing:
        await published(publishing, block(plant, 0))
        async with looking(server) as stream:
            await stream.delete_stream(stream_name(plant))
        await published(publishing, block(plant, 1))

    assert [found.first_index for found in await kept(plant, server)] == [60]
