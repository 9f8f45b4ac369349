"""A replica beside a service that analyses, over the same database."""

from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Any

import httpx2
import pytest
from rigs.described import described_app

from core.alarms.alarm import PLANT
from service.app.replica_process import Replica
from service.cluster.measuring_side import CommandWorker, Reporter
from service.measuring.commands import CommandExecutor
from service.measuring.snapshots import Reports
from service.runtime.heartbeats import Heartbeats
from service.settings.plant import PlantFile


@dataclass
class Pair:
    """The service, and who shows what it writes down."""

    service: Any
    replica: Replica
    client: httpx2.AsyncClient
    reporter: Reporter
    carrying_out: CommandWorker

    async def told(self) -> None:
        """Let the service report, and the replica read it."""
        await self.reporter.report()
        await self.replica.feed.look()

    def pass_time(self, seconds: float) -> None:
        """Let time pass for both, whose clocks agree."""
        self.service.clock.step(round(seconds * 1e9))

    async def json(self, path: str) -> Any:
        answer = await self.client.get(path)
        assert answer.status_code == 200, answer.text
        return answer.json()


def process_of(service: Any, plant: PlantFile, name: str) -> tuple[Reporter, CommandWorker]:
    """What a process that analyses adds to the service."""
    held = [*(unit.id for unit in plant.unit), PLANT]
    parts = (service.alarms, service.films)
    store, clock = service.store, service.clock
    reports = Reports(name, lambda: held, plant.unit, service.live, *parts)
    executor = CommandExecutor(*parts, service.live, service.recorder, store, clock)
    return (
        Reporter(reports, store.unit_states, clock),
        CommandWorker(name, lambda: held, executor, store, clock),
    )


@pytest.fixture
async def pair(running: Any, plant: PlantFile) -> AsyncIterator[Pair]:
    """Both, and the replica has seen two reports: it knows that somebody is alive."""
    reporter, carrying_out = process_of(running, plant, "one")
    replica = Replica(plant, running.store, running.clock)
    await replica.feed.start()
    app = described_app(replica.context(running.context.access, Heartbeats(running.clock)))
    transport = httpx2.ASGITransport(app)
    async with httpx2.AsyncClient(transport=transport, base_url="http://padwatch") as client:
        both = Pair(running, replica, client, reporter, carrying_out)
        await both.told()
        await both.told()
        yield both
