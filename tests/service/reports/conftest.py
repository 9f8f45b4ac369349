"""A plant with results, alarms that are raised on it, and the keeper of their evidence."""

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from harness.waiting import at_work, until

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.life_cycle import update
from core.limits import AlarmLevel, Judgement
from core.quality import Reading
from service.app.kept_files import captures_of, evidence_of
from service.app.storage import evidence_folders
from service.live.status import LinkState
from service.measuring.films import FilmMonitor, film_monitor
from service.measuring.live_view import LiveView
from service.reports.archive import EvidenceArchive
from service.reports.folders import CapturePart, linked
from service.settings.core_values import machine_of
from service.settings.plant import PlantFile, load_plant_file
from service.settings.storage import Origin
from service.store.sqlite import SqliteStore

T0 = 1_767_225_600_000_000_000
SECOND = 1_000_000_000


def news_of(
    at_s: float = 0.0,
    kind: str = "order1_shaft_x",
    subject: str = "UJB",
    unit: str = "U1",
    occurrence: int = 1,
) -> AlarmNews:
    """An alarm that has just been raised for the so-many-th time."""
    before = occurrence - 1
    identity = AlarmIdentity(unit, subject, kind)
    alarm = Alarm(identity, occurrence=before, n_events=before)
    found = Judgement(AlarmLevel.ALERT, value=160.0, limit=150.0, reason="above_limit")
    return AlarmNews(*update(alarm, found, T0 + round(at_s * SECOND), AlarmRule()))


class Rig:
    """A plant's evidence on a real disk beside a real store."""

    until = staticmethod(until)

    def __init__(
        self, plant: PlantFile, clock: Any, films: FilmMonitor, store: SqliteStore, live: LiveView
    ) -> None:
        self.plant, self.clock, self.store, self.live, self.films = plant, clock, store, live, films
        self.folders = evidence_folders(plant)
        captures = captures_of(plant, Origin.REPLAY, clock)
        self.keeper = evidence_of(plant, Origin.LIVE, live, films, store, captures, clock)
        self.archive = EvidenceArchive(self.folders, store)

    def raise_(self, news: AlarmNews) -> None:
        """Let it happen: seen, and stored."""
        self.keeper.see([news])
        self.store.append([], [], [news])

    async def written(self, n: int) -> None:
        await self.until(lambda: self.keeper.n_written == n and self.keeper.n_pending == 0)

    async def linked(self) -> CapturePart:
        """Wait until the first bundle has its link."""
        await self.until(lambda: bool(self.bundles) and linked(self.bundles[0]) is not None)
        found = linked(self.bundles[0])
        assert found is not None
        return found

    async def write(self, *raised: AlarmNews) -> None:
        """Raise alarms while the keeper runs, and wait for the evidence of each."""
        async with self.running():
            for news in raised:
                self.raise_(news)
            await self.written(len(raised))

    @property
    def bundles(self) -> list[Path]:
        return sorted(path for path in self.folders.evidence.glob("*/*") if path.is_dir())

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        async with at_work(self.keeper.run()):
            yield
        await self.keeper.close()


@pytest.fixture
def news() -> Callable[..., AlarmNews]:
    return news_of


@pytest.fixture
def plant(tmp_path: Path, deploy: Path) -> PlantFile:
    """The demonstration plant, its data in a folder of the test."""
    found = load_plant_file(deploy / "demo.toml")
    service = found.service.model_copy(update={"data_folder": str(tmp_path / "data")})
    return found.model_copy(update={"service": service})


@pytest.fixture
async def rig_of(plant, tmp_path, stepped_clock, assessment) -> AsyncIterator[Callable[..., Any]]:
    """Builds a rig; another one over the same plant is the service after a restart."""
    opened: list[SqliteStore] = []

    async def build(of: PlantFile = plant) -> Rig:
        store = SqliteStore(tmp_path / "padwatch.sqlite3")
        opened.append(store)
        live = LiveView([unit.id for unit in of.unit], stepped_clock, 30.0)
        live.set_link("U1", LinkState.CONNECTED)
        for bearing in ("UJB", "LJB"):
            live.set_assessment(assessment(bearing=bearing, order1_shaft_x_um_pk=Reading(160.0)))
        machines = {unit.id: machine_of(unit) for unit in of.unit}
        films = await film_monitor(of, machines, store.films, stepped_clock)
        return Rig(of, stepped_clock, films, store, live)

    yield build
    for store in opened:
        store.close()


@pytest.fixture
async def rig(rig_of: Callable[..., Any]) -> Rig:
    """The service before any restart."""
    found: Rig = await rig_of()
    return found
