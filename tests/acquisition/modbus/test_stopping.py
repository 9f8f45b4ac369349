"""A service that is told to stop stops, whatever arrives at that moment."""

import asyncio

import pytest

from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer


@pytest.mark.parametrize("done", ["a reply", "a connection"])
async def test_what_is_done_with_the_stop_does_not_undo_it(done, counting_feed, link_to):
    async with ModbusRingServer(RingDevice(counting_feed())) as server:
        link = link_to(server.port)
        if done == "a reply":
            await link.open()
            stopped = asyncio.create_task(link.read(0, 16))
            judge = link._connection._framer.handleFrame

            def stop_and_judge(*arguments):
                stopped.cancel()
                return judge(*arguments)

            link._connection._framer.handleFrame = stop_and_judge
        else:
            stopped = asyncio.create_task(link.open())
            create = link._connection._client.ctx.call_create

            async def create_and_stop():
                made = await create()
                stopped.cancel()
                return made

            link._connection._client.ctx.call_create = create_and_stop
        await asyncio.wait([stopped], timeout=30)
        assert stopped.cancelled()
        link.close()
