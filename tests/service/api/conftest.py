"""The API over a real store and a real monitor, fed by the simulated plant, asked in process."""

import asyncio
import pickle
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import httpx2
import pytest
from fastapi import FastAPI
from harness.waiting import at_work
from rigs.capturing import ALERT, T0
from rigs.database_copy import copy_database
from rigs.described import described_app
from rigs.probes import Probes
from rigs.standing_clock import SetClock

from core.alarms.alarm import PLANT, Alarm, AlarmIdentity, AlarmRule
from core.alarms.life_cycle import update
from core.monitor.assessment import Assessment
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from service.api.auth.authenticator import Authenticator
from service.api.context import Context
from service.app.kept_files import captures_of, evidence_of
from service.app.serving_process import evidence_of as downloads_of
from service.app.storage import built_configuration, evidence_folders
from service.live.client import LiveClient
from service.live.commands import Operators
from service.live.exchange import Question, ServingEnd
from service.live.references import ReferencesInForce
from service.live.snapshot import PlantSnapshot
from service.live.status import LinkState
from service.measuring.alarm_engine import AlarmEngine, alarm_engine
from service.measuring.commands import CommandExecutor, Questions
from service.measuring.films import FilmMonitor, film_monitor
from service.measuring.integrity import IntegrityMonitor
from service.measuring.live_view import LiveView
from service.measuring.recorder import Recorder
from service.measuring.simulated_sources import simulated_feed
from service.measuring.snapshots import Reports
from service.notifications.sender import Deliveries
from service.recordings.segment import CaptureFile
from service.reports.collector import EvidenceCollector
from service.reports.routes import EvidenceService
from service.settings.core_values import analysis_of, machine_of
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.access.identities import Role
from service.store.access.tables import AccessStore
from service.store.sqlite import SqliteStore
from service.store.sqlite.store import open_access_file

DEMO = Path(__file__).parents[3] / "deploy" / "demo.toml"

N_RESULTS = 6
STALE_AFTER_S = 30.0


@pytest.fixture(scope="session")
def assessments(plant: PlantFile) -> list[Assessment]:
    """What a monitor of unit U1 finds in the first minutes, oldest first."""
    unit = plant.unit[0]
    feed = simulated_feed(unit, SetClock())
    settings = analysis_of(plant.analysis)
    monitor = UnitMonitor(machine_of(unit), settings)
    n_samples = settings.segment_samples + (N_RESULTS - 1) * settings.hop_samples
    return list(monitor.steps(feed.advance(n_samples)))


@dataclass
class Service:
    """Everything behind the API, for tests to change."""

    live: LiveView
    serving: LiveClient
    reports: Reports
    store: SqliteStore
    access: AccessStore
    clock: SetClock
    references: ReferencesInForce
    alarms: AlarmEngine
    recorder: Recorder
    evidence: EvidenceCollector
    films: FilmMonitor
    loops: dict[str, str | None]
    context: Context
    desk: EvidenceService

    @cached_property
    def app(self) -> FastAPI:
        """The application, built for the first test that sends a request to it."""
        return described_app(self.context, self.desk)

    async def told(self) -> None:
        """Let the measuring side report, and the serving side take the report."""
        copied = pickle.loads(pickle.dumps(self.reports.report(False)))  # noqa: S301
        await self.serving.take(copied, is_direct=True)

    @cached_property
    def client(self) -> httpx2.AsyncClient:
        """A browser on the same computer."""

        async def after_reports(*asgi: Any) -> None:
            await self.told()
            await self.app(*asgi)

        transport = httpx2.ASGITransport(after_reports)
        return httpx2.AsyncClient(transport=transport, base_url="http://padwatch")

    @property
    def document(self) -> dict[str, Any]:
        """The published description of the API."""
        return self.app.openapi()

    async def get(self, path: str, **parameters: object) -> httpx2.Response:
        return await self.client.get(path, params=parameters)

    async def json(self, path: str, **parameters: object) -> Any:
        response = await self.get(path, **parameters)
        assert response.status_code == 200, response.text
        assert response.headers["content-type"] == "application/json"
        return response.json()

    async def problem(self, path: str, status: int, **parameters: object) -> dict[str, Any]:
        response = await self.get(path, **parameters)
        assert response.status_code == status, response.text
        return problem_of(response)

    async def refused(self, path: str, status: int, body: Any, **headers: str) -> dict[str, Any]:
        """The problem document of an action that must be refused."""
        response = await self.client.post(path, json=body, headers=headers)
        assert response.status_code == status, body
        return problem_of(response)


Serve = Callable[[PlantFile, Path], Service]


class DirectExchange(ServingEnd):
    """Questions to the measuring side without the socket between two processes."""

    def __init__(self, questions: Questions) -> None:
        self._questions = questions

    async def ask(self, kind: str, document: str, actor: str = "", peer: str | None = None) -> Any:
        answer = await self._questions.answer(Question(1, kind, document, actor, peer))
        return pickle.loads(pickle.dumps(answer))  # noqa: S301


async def no_metrics() -> bytes:
    return b""


def problem_of(response: httpx2.Response) -> dict[str, Any]:
    """The problem document of a response, checked."""
    assert response.headers["content-type"] == "application/problem+json"
    body: dict[str, Any] = response.json()
    assert set(body) == {"type", "title", "status", "detail", "instance", "errors"}
    assert body["status"] == response.status_code
    assert body["instance"] == response.url.path
    assert body["title"]
    assert body["detail"]
    return body


@pytest.fixture
def as_problem() -> Callable[[httpx2.Response], dict[str, Any]]:
    return problem_of


async def build(plant: PlantFile, store: SqliteStore, access: AccessStore, folder: Path) -> Service:
    """Build a service that has just started: nothing is connected, nothing recorded yet."""
    clock = SetClock()
    live = LiveView([unit.id for unit in plant.unit], clock, STALE_AFTER_S)
    analysis = analysis_of(plant.analysis)
    monitors = {unit.id: UnitMonitor(machine_of(unit), analysis) for unit in plant.unit}
    references = ReferencesInForce([monitor.unit for monitor in monitors.values()], store, clock)
    recorder = Recorder(store, live, clock, folder)
    alarms = await alarm_engine(plant, Origin.LIVE, store, recorder.put, clock)
    captures = captures_of(plant, Origin.REPLAY, clock)
    machines = {unit: monitor.unit for unit, monitor in monitors.items()}
    films = await film_monitor(plant, machines, store.films, clock)
    service = plant.service.model_copy(update={"data_folder": str(folder)})
    own = plant.model_copy(update={"service": service})
    evidence = evidence_of(own, Origin.LIVE, live, films, store, captures, clock)
    alarms.set_observer(evidence.see)
    captures.set_listener(evidence.captured)
    loops: dict[str, str | None] = {}
    executor = CommandExecutor(alarms, films, live, recorder, store, clock)
    integrity = IntegrityMonitor(store, clock, live)
    exchange = DirectExchange(Questions(executor, integrity, no_metrics))
    serving = LiveClient(plant, store.films, clock, exchange.ask)
    serving.alarms.take_stored(store.alarms())
    operators = Operators(exchange.send, store, serving.alarms)
    ids = [*(unit.id for unit in plant.unit), PLANT]

    def plant_now() -> PlantSnapshot:
        return PlantSnapshot(
            loops=dict(loops),
            checks={"stored data": integrity.trouble or "ok"},
            audit_error=store.audit.head_error,
            evidence=evidence.status,
        )

    reports = Reports("measuring", lambda: ids, plant.unit, live, alarms, films, plant_now)
    context = Context(
        plant_name=plant.plant.name,
        units={unit.id: unit for unit in plant.unit},
        live=serving.units,
        store=store,
        clock=clock,
        refresh_s=11.95,
        references=references,
        alarms=serving.alarms,
        films=serving.films,
        plant=lambda: serving.plant,
        operators=operators,
        receivers=Deliveries([], store.outbox, clock).look,
        max_shelf_s=7200.0,
        configuration=built_configuration(own),
        recordings=[evidence_folders(own).captures],
        access=Authenticator(access, clock, Role.ADMIN),  # as in the demonstration
    )
    desk = downloads_of(own, context)
    return Service(
        *(live, serving, reports, store, access, clock, references, alarms, recorder, evidence),
        *(films, loops, context, desk),
    )


def show(service: Service, assessments: list[Assessment]) -> Service:
    """Connect U1 and give it results; U2 was never connected."""
    service.live.set_link("U1", LinkState.CONNECTED)
    service.live.set_link("U2", LinkState.NOT_CONNECTED, "127.0.0.1:502: Connection refused")
    for assessment in assessments:
        service.live.set_assessment(assessment)
    service.store.append(assessments, [])
    return service


@pytest.fixture(scope="session")
def serve(tmp_path_factory: pytest.TempPathFactory, access_file: Path) -> Iterator[Serve]:
    """Builds services on copies of a database that several tests share, because these only read."""
    with ExitStack() as stack:

        def begin(plant: PlantFile, database_file: Path) -> Service:
            folder = tmp_path_factory.mktemp("shared")
            store = SqliteStore(copy_database(database_file, folder))
            access = open_access_file(copy_database(access_file, folder))
            stack.callback(store.close)
            stack.callback(access.close)
            return asyncio.run(build(plant, store, access, folder))

        yield begin


@pytest.fixture(scope="session")
def read_only(serve, plant, database_file, assessments) -> Service:
    """The service of `running`, for all tests that change nothing of it."""
    return show(serve(plant, database_file), assessments)


@pytest.fixture
async def service(plant, store, access_store, tmp_path) -> AsyncIterator[Service]:
    """A service of the test's own that has just started."""
    built = await build(plant, store, access_store, tmp_path)
    async with at_work(built.recorder.run()):
        yield built


@pytest.fixture
def running(service: Service, assessments: list[Assessment]) -> Service:
    """U1 connected, its results shown and stored; U2 never connected."""
    return show(service, assessments)


@pytest.fixture
def capture(tmp_path: Path) -> Callable[..., Path]:
    """Puts a recording of blocks, made for an alarm, where captures are."""

    def make(unit: str, blocks: list[SampleBlock], writer: Any, at_s: int = 0) -> Path:
        alarm = Alarm(AlarmIdentity(unit, "UJB", "order1_shaft_x"))
        _, events = update(alarm, ALERT, T0 + at_s * 1_000_000_000, AlarmRule())
        file = CaptureFile(tmp_path / "captures", events[0], writer)
        file.write(blocks)
        file.finish(events)
        assert file.finished is not None
        return file.finished

    return make


@pytest.fixture
def probes(service: Any) -> Probes:
    """The first probe of unit U1, which may fail."""
    return Probes(service)
