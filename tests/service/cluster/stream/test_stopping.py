"""Who is told to stop while the library waits does stop, though the library does not hear it."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest
from nats.aio.client import Client

from acquisition.clock import SystemClock
from service.cluster.consumer import Consumer
from service.cluster.frames import UnitIdentity
from service.cluster.publisher import Outgoing, Publisher
from service.settings.plant import PlantFile
from service.settings.processes import StreamSettings

SETTINGS = StreamSettings(servers=("nats://127.0.0.1:9",))


class DeafStream:
    """One whose waits end as if what they wait for had come, when they are cancelled."""

    def __init__(self) -> None:
        self.is_waiting = asyncio.Event()

    async def wait(self, *_: Any, **__: Any) -> Any:
        self.is_waiting.set()
        try:
            await asyncio.sleep(3600.0)
        except asyncio.CancelledError:
            self.is_waiting.clear()
        return self

    def __iter__(self) -> Any:
        return iter(())

    def __getitem__(self, _: int) -> Any:
        return SimpleNamespace(metadata=SimpleNamespace(num_pending=0))

    @property
    def duplicate(self) -> bool:
        return False

    async def delete_consumer(self, *_: Any) -> None: ...

    async def add_consumer(self, *_: Any) -> None: ...

    async def pull_subscribe_bind(self, *_: Any) -> Any:
        return SimpleNamespace(fetch=self.wait)

    publish = wait


async def require_it_stops(task: asyncio.Task[None], stream: DeafStream) -> None:
    await stream.is_waiting.wait()
    task.cancel()
    done, _ = await asyncio.wait([task], timeout=30.0)
    assert done
    assert task.cancelled()


@pytest.fixture
def stream() -> Any:
    return DeafStream()


@pytest.fixture
def consumer(plant: PlantFile) -> Consumer:
    return Consumer(plant, SETTINGS, Any, Any, SystemClock())  # type: ignore[arg-type]


@pytest.fixture
def publisher(plant: PlantFile, identity: UnitIdentity) -> Publisher:
    return Publisher(plant, SETTINGS, {"U1": identity}, SystemClock())


async def test_a_consumer_that_waits_for_messages(consumer, stream):
    consumer._fetched["U1"] = 0
    await require_it_stops(asyncio.create_task(consumer._fetch_unit(stream, "U1")), stream)


async def test_a_publisher_that_waits_for_the_servers(publisher, stream):
    publisher.waiting.add("U1", Outgoing("1", b"a block"))
    publisher.waiting.add("U1", Outgoing("2", b"another"))
    pulse = SimpleNamespace(beat=lambda *_: None, rest=lambda: None)
    task = asyncio.create_task(publisher._send_unit(stream, "U1", pulse))
    await require_it_stops(task, stream)


@pytest.mark.parametrize("refusal", [None, ConnectionRefusedError()])
async def test_both_while_they_wait_for_a_connection(
    consumer, publisher, stream, monkeypatch, refusal
):
    async def connect(*_: object, **__: object) -> None:
        await stream.wait()
        if refusal is not None:
            raise refusal

    async def close(*_: object) -> None: ...

    monkeypatch.setattr(Client, "connect", connect)
    monkeypatch.setattr(Client, "close", close)
    for one in (consumer, publisher):
        await require_it_stops(asyncio.create_task(one.run()), stream)
