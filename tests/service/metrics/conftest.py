"""A real service over scripted devices, asked over HTTP as Prometheus asks it."""

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import httpx2
import pytest
from prometheus_client import Metric
from prometheus_client.parser import text_string_to_metric_families

from acquisition.calibration import calibrate
from acquisition.clock import Clock, SystemClock
from acquisition.errors import LinkError
from acquisition.source import SampleSource
from core.account import SampleAccount
from core.blocks import Rejection, SampleBlock
from core.device_clock import DeviceClock
from core.quality import Reason, bad
from service.conversion import calibration_of
from service.metrics.polls import TimedSource
from service.program import Performance, listen, run_service
from service.runner import WatchedUnit
from service.settings.loading import load_plant_file
from service.settings.plant import PlantFile
from service.wiring.simulations import simulated_feed
from service.wiring.sources import monitor_of

DEMO = Path(__file__).parents[3] / "deploy" / "demo.toml"
BLOCK = 1024
N_BLOCKS = 20
PATIENCE_S = 60.0

RECEIVER = """
[[delivery.receiver]]
id = "control-room"
kind = "webhook"
url = "http://127.0.0.1:9/alarms"
"""


class ScriptedDevice:
    """Delivers blocks, with a wait after each, then holds the line until it is let go."""

    def __init__(self, blocks: Sequence[SampleBlock], clock: Clock, let_go: asyncio.Event) -> None:
        self._blocks, self._clock, self._let_go = blocks, clock, let_go

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        if not self._blocks and not self._let_go.is_set():
            raise LinkError("nobody answers")
        yield self._deliver()

    async def _deliver(self) -> AsyncIterator[SampleBlock]:
        for block in self._blocks:
            yield block
            await self._clock.sleep(0.0)
        await self._let_go.wait()


def plant_in(folder: Path) -> PlantFile:
    """The demonstration plant with a receiver of alarms and its data in a folder."""
    path = folder / "plant.toml"
    path.write_text(DEMO.read_text(encoding="utf-8") + RECEIVER, encoding="utf-8")
    plant = load_plant_file(path)
    service = plant.service.model_copy(update={"data_folder": str(folder)})
    return plant.model_copy(update={"service": service})


@pytest.fixture(scope="module")
def blocks() -> list[SampleBlock]:
    """What unit U1 delivers: one block missing, one refused in part, one not good."""
    unit = load_plant_file(DEMO).unit[0]
    feed, calibration = simulated_feed(unit, SystemClock()), calibration_of(unit)
    found = [calibrate(feed.advance(BLOCK), calibration) for _ in range(N_BLOCKS)]
    found[5] = replace(found[5], rejected=(Rejection("checksum", 100), Rejection("ÄÖÜ {}", 7)))
    flagged = (bad(Reason.SENSOR_FAILURE), *found[7].channel_quality[1:])
    found[7] = replace(found[7], channel_quality=flagged)
    found[-1] = replace(found[-1], clock=DeviceClock(0.25, None, None))
    return [block for number, block in enumerate(found) if number != 4]


@dataclass
class Running:
    """A running service."""

    client: httpx2.AsyncClient
    folder: Path

    async def metrics(self) -> dict[str, Metric]:
        """All families, by the name that is written above them."""
        response = await self.client.get("/metrics")
        assert response.status_code == 200, response.text
        return {family.name: family for family in text_string_to_metric_families(response.text)}

    async def value(self, name: str, **labels: str) -> float | None:
        """One number; None if it is not told."""
        families = await self.metrics()
        return values(families, name).get(frozenset(labels.items()))

    async def until(self, name: str, wanted: Callable[[float], bool], **labels: str) -> None:
        """Ask until a number is as wanted."""
        async with asyncio.timeout(PATIENCE_S):
            while not wanted(await self.value(name, **labels) or 0.0):
                await asyncio.sleep(0.02)


def values(families: dict[str, Metric], name: str) -> dict[frozenset[tuple[str, str]], float]:
    """The numbers of one name, by their labels."""
    return {
        frozenset(sample.labels.items()): sample.value
        for family in families.values()
        for sample in family.samples
        if sample.name == name
    }


@pytest.fixture
async def running(tmp_path: Path, blocks: list[SampleBlock]) -> AsyncIterator[Running]:
    """U1 has delivered all its blocks, U2 does not answer."""
    plant, clock, let_go = plant_in(tmp_path), SystemClock(), asyncio.Event()
    scripts = {unit.id: blocks if unit.id == "U1" else [] for unit in plant.unit}

    def device(unit: str) -> Callable[[Clock], SampleSource]:
        return lambda clock: ScriptedDevice(scripts[unit], clock, let_go)

    units = {
        unit.id: WatchedUnit(
            TimedSource(device(unit.id), clock), monitor_of(unit, plant.analysis), retry_s=0.05
        )
        for unit in plant.unit
    }
    url = asyncio.get_running_loop().create_future()
    with listen("127.0.0.1", 0) as listener:
        performance = Performance(plant, units, ends=True)
        serving = asyncio.create_task(run_service(performance, listener, clock, url.set_result))
        await asyncio.wait([serving, url], return_when=asyncio.FIRST_COMPLETED)
        if serving.done():
            serving.result()
        async with httpx2.AsyncClient(base_url=await url, trust_env=False) as client:
            service = Running(client, tmp_path)
            everything = float(blocks[-1].stop_index)
            await service.until(
                "padwatch_samples_offered_total", lambda n: n == everything, unit="U1"
            )
            yield service
        let_go.set()
        await serving


@pytest.fixture
def account() -> SampleAccount:
    """Where the samples of U1 must have gone."""
    return SampleAccount(
        n_stored=BLOCK * (N_BLOCKS - 2),
        n_flagged=BLOCK,
        n_gap=BLOCK - 107,
        rejected={"checksum": 100, "other": 7},
    )


@pytest.fixture
def numbers() -> Callable[[dict[str, Metric], str], dict[frozenset[tuple[str, str]], float]]:
    return values
