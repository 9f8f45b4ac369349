"""A real service over scripted devices, asked once over HTTP as Prometheus asks it."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import httpx2
import pytest
from prometheus_client import Metric
from prometheus_client.parser import text_string_to_metric_families
from rigs.blocks import with_quality

from acquisition.clock import Clock, SystemClock
from acquisition.errors import LinkError
from acquisition.source import SampleSource
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.quality import Level, Quality, Reading, Reason, bad, missing
from core.samples.blocks import DeviceClock, Rejection, SampleBlock
from core.samples.gaps import SampleAccount
from service.app.measuring_process import run_service
from service.app.process import Host
from service.live.status import LinkState
from service.measuring.analyser import ASSESSMENTS
from service.measuring.live_view import LiveView
from service.measuring.simulated_sources import simulated_feed
from service.measuring.sources import WatchedUnit
from service.runtime.listening import listen
from service.runtime.polls import TimedSource
from service.settings.plant import PlantFile, load_plant_file

DEMO = Path(__file__).parents[4] / "deploy" / "demo.toml"
BLOCK = 1024
N_BLOCKS = 20
PATIENCE_S = 240.0
"""Until the tests give up; none waits that long when all is well."""

LOOK_EVERY_S = 0.2

ACCEPTS = {
    "plain": "*/*",
    "openmetrics": "application/openmetrics-text;version=1.0.0,text/plain;version=0.0.4;q=0.5",
    "strange": "text/plain;version=x.y;escaping=<b>, application/openmetrics-text;version=zzz",
}

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
        self.refused_frames = {"duplicate": 2} if blocks else {}

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


def scripted_blocks() -> list[SampleBlock]:
    """What unit U1 delivers: one block missing, one refused in part, one not good."""
    unit = load_plant_file(DEMO).unit[0]
    feed = simulated_feed(unit, SystemClock())
    found = [feed.advance(BLOCK) for _ in range(N_BLOCKS)]
    found[5] = replace(found[5], rejected=(Rejection("checksum", 100), Rejection("ÄÖÜ {}", 7)))
    flagged = (bad(Reason.SENSOR_FAILURE), *found[7].channel_quality[1:])
    found[7] = with_quality(found[7], flagged)
    found[-1] = replace(found[-1], clock=DeviceClock(0.25, None, None))
    return [block for number, block in enumerate(found) if number != 4]


Numbers = Mapping[frozenset[tuple[str, str]], float]


@dataclass(frozen=True)
class Scrape:
    """One answer to Prometheus."""

    text: str
    headers: Mapping[str, str]

    @property
    def families(self) -> dict[str, Metric]:
        """All families, by the name that is written above them."""
        return {family.name: family for family in text_string_to_metric_families(self.text)}

    def numbers(self, name: str) -> Numbers:
        """The numbers of one name, by their labels."""
        return {
            frozenset(sample.labels.items()): sample.value
            for family in self.families.values()
            for sample in family.samples
            if sample.name == name
        }

    def value(self, name: str, **labels: str) -> float | None:
        """One number; None if it is not told."""
        return self.numbers(name).get(frozenset(labels.items()))


@dataclass(frozen=True)
class Told:
    """All that the service was asked for, and said.

    Parameters
    ----------
    scrapes
        By how they were asked for.
    blind
        While what waits for receivers could not be read.
    """

    scrapes: Mapping[str, Scrape]
    blind: Scrape
    sources: list[dict[str, Any]]

    @property
    def plain(self) -> Scrape:
        """As Prometheus asks."""
        return self.scrapes["plain"]


async def told_by_a_service(folder: Path) -> Told:
    """Run it over U1, which delivers its blocks, and U2, which does not answer."""
    blocks = scripted_blocks()
    plant, clock, let_go = plant_in(folder), SystemClock(), asyncio.Event()
    scripts = {unit.id: blocks if unit.id == "U1" else [] for unit in plant.unit}

    def device(unit: str) -> Callable[[Clock], SampleSource]:
        return lambda clock: ScriptedDevice(scripts[unit], clock, let_go)

    units = {
        unit.id: WatchedUnit(TimedSource(device(unit.id), clock), retry_s=0.5)
        for unit in plant.unit
    }
    said: asyncio.Queue[str] = asyncio.Queue()
    url = asyncio.create_task(said.get())
    with listen("127.0.0.1", 0) as listener:
        service = run_service(plant, units, Host(listener, clock, said.put_nowait), ends=True)
        serving = asyncio.create_task(service)
        await asyncio.wait([serving, url], return_when=asyncio.FIRST_COMPLETED)
        if serving.done():
            serving.result()
        async with httpx2.AsyncClient(
            base_url=await url, trust_env=False, timeout=PATIENCE_S
        ) as client:
            await until_all_is_told(client, float(blocks[-1].stop_index))
            found = await asked(client, folder)
        let_go.set()
        await serving
    return found


async def until_all_is_told(client: httpx2.AsyncClient, n_samples: float) -> None:
    """Wait until all blocks have been analysed and something has been stored."""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            seen = await scraped(client)
            offered = seen.value("padwatch_samples_offered_total", unit="U1")
            stored = seen.value("padwatch_store_commit_duration_seconds_count")
            waiting = seen.value("padwatch_store_waiting_findings")
            told = seen.numbers("padwatch_result_age_seconds")
            if offered == n_samples and stored and waiting == 0.0 and told:
                return
            await asyncio.sleep(LOOK_EVERY_S)


async def scraped(client: httpx2.AsyncClient, accept: str = "*/*") -> Scrape:
    answer = await client.get("/metrics", headers={"accept": accept})
    assert answer.status_code == 200, answer.text
    return Scrape(answer.text, dict(answer.headers))


async def asked(client: httpx2.AsyncClient, folder: Path) -> Told:
    scrapes = {name: await scraped(client, accept) for name, accept in ACCEPTS.items()}
    database = folder / "padwatch.sqlite3"
    database.rename(folder / "elsewhere")
    blind = await scraped(client)
    (folder / "elsewhere").rename(database)
    return Told(
        scrapes=scrapes,
        blind=blind,
        sources=(await client.get("/api/v1/sources")).json(),
    )


@pytest.fixture(scope="session")
def told(tmp_path_factory: pytest.TempPathFactory) -> Told:
    """What one service said, which has ended by now."""
    ASSESSMENTS.clear()  # of services before
    return asyncio.run(told_by_a_service(tmp_path_factory.mktemp("metrics")))


@pytest.fixture(scope="session")
def account() -> SampleAccount:
    """Where the samples of U1 must have gone."""
    return SampleAccount(
        n_stored=BLOCK * (N_BLOCKS - 2),
        n_flagged=BLOCK,
        n_gap=BLOCK - 107,
        rejected={"checksum": 100, "other": 7},
    )


@pytest.fixture
def live(assessment: Callable[..., Assessment], stepped_clock: Any) -> LiveView:
    """A result of U1 with a stiffness in x, an uncertain one in y and a bad 1× amplitude."""
    live = LiveView(["U1", "U2"], stepped_clock, 30.0)
    live.set_link("U1", LinkState.CONNECTED)
    found = assessment()
    uncertain = Quality(Level.UNCERTAIN, Reason.POOR_FIT)
    readings = {
        **found.readings,
        "stiffness_xx_n_per_m": Reading(1.5e9),
        "stiffness_yy_n_per_m": Reading(1.25e9, uncertain),
        "order1_shaft_x_um_pk": Reading(80.0),
        "order1_shaft_y_um_pk": missing(Reason.SENSOR_FAILURE),
        "eccentricity_ratio": Reading(0.3),
        "oil_temperature_c": Reading(45.5),
    }
    estimators = {"xx": Estimator.DYNAMIC, "yy": Estimator.TRANSFER_ORDER1}
    live.set_assessment(replace(found, readings=readings, estimators=estimators))
    return live
