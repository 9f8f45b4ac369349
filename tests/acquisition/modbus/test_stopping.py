"""A service that is told to stop stops, whatever arrives at that moment."""

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest

from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer
from acquisition.modbus.link import ModbusLink


@pytest.fixture
async def link(
    counting_feed: Callable[..., Any], link_to: Callable[..., ModbusLink]
) -> AsyncIterator[ModbusLink]:
    async with ModbusRingServer(RingDevice(counting_feed())) as server:
        opened = link_to(server.port)
        yield opened
        opened.close()


async def test_a_reply_that_arrives_with_the_stop_does_not_undo_it(link: ModbusLink) -> None:
    await link.open()
    reading = asyncio.create_task(link.read(0, 16))
    judge = link._connection._framer.handleFrame

    def stop_and_judge(*arguments: Any) -> Any:
        reading.cancel()
        return judge(*arguments)

    link._connection._framer.handleFrame = stop_and_judge  # type: ignore[method-assign]
    await asyncio.wait([reading], timeout=30)

    assert reading.cancelled()


async def test_a_connection_that_is_made_with_the_stop_does_not_undo_it(link: ModbusLink) -> None:
    opening = asyncio.create_task(link.open())
    create = link._connection._client.ctx.call_create

    async def create_and_stop() -> Any:
        made = await create()
        opening.cancel()
        return made

    link._connection._client.ctx.call_create = create_and_stop
    await asyncio.wait([opening], timeout=30)

    assert opening.cancelled()
