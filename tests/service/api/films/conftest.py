"""A service that has watched a made-up machine for sixty days and learned its upper bearing."""

import asyncio
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from core.baseline.history import DIRECTIONS, StiffnessHistory
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.quality import GOOD, Quality, Reading
from service.live.commands import FilmPlace
from service.live.status import LinkState
from service.measuring.baseline_learning import Learner
from service.settings.plant import PlantFile, load_plant_file
from service.store.sqlite import SqliteStore

DEMO = Path(__file__).parents[4] / "deploy" / "demo.toml"
UJB = FilmPlace("U1", "UJB", Estimator.DYNAMIC)
N_DAYS = 60
PERIOD_NS = 600 * 10**9
CONDITION_COLUMNS = (
    *("speed_rpm", "power_mw", "eccentricity_ratio", "u_eccentricity"),
    *("attitude_deg", "oil_temperature_c"),
)


@pytest.fixture(scope="session")
def plant(tmp_path_factory: pytest.TempPathFactory) -> PlantFile:
    """The demonstration plant, the films of unit U1 watched; U2 has no rated power."""
    path = tmp_path_factory.mktemp("films") / "plant.toml"
    power = 'power_channel = "active_power"\n'
    head = "[films.operating]\nwarm_up_s = 3600.0\n\n[[unit]]"
    text = DEMO.read_text(encoding="utf-8").replace(power, power + "rated_power_mw = 330.0\n", 1)
    path.write_text(text.replace("[[unit]]", head, 1), encoding="utf-8")
    return load_plant_file(path)


@pytest.fixture(scope="session")
def lived(film_life: Callable[..., StiffnessHistory]) -> StiffnessHistory:
    """Days of a film whose damping over stiffness falls with eccentricity."""
    history = film_life(3, days=N_DAYS)
    noise = np.random.default_rng(3).normal(0.0, 0.004, history.ln_k.shape)
    ln_ck = math.log(0.03) - 0.4 * (history.eccentricity_ratio - 0.35) + noise
    return replace(history, ln_ck=ln_ck, u_ck=np.full(ln_ck.shape, 0.004))


@pytest.fixture(scope="session")
def database_file(tmp_path_factory, plant, lived, film_news) -> Path:
    """A database with these days and the baseline that was learned of them, for copies."""
    path = tmp_path_factory.mktemp("learned") / "padwatch.sqlite3"
    store = SqliteStore(path)
    limits = plant.films.operating.limits(92.3, 330.0)
    store.films.add_simulated(film_news(lived, limits))
    assert Learner(store.films, plant.films).learn(UJB, int(lived.time_ns[-1])) is not None
    store.close()
    return path


@pytest.fixture(scope="session")
def learned(serve: Any, plant: PlantFile, database_file: Path) -> Any:
    """A service over these days, for tests that change nothing of it."""
    return serve(plant, database_file)


class Machine:
    """Unit U1 after these days, run on by a test: one result of each bearing every ten minutes."""

    def __init__(
        self, service: Any, lived: StiffnessHistory, assessment: Callable[..., Assessment]
    ) -> None:
        self._service, self._lived, self._assessment = service, lived, assessment
        self.time_ns = int(lived.time_ns[-1])
        service.live.set_link("U1", LinkState.CONNECTED)
        self.run(1)  # in the first interval nothing is read

    def run(
        self,
        n: int,
        ln_change: float = 0.0,
        quality: Quality = GOOD,
        ck_change: float = 0.0,
        **other: Any,
    ) -> None:
        """Go on for some intervals, under the condition of the newest reading that was learned."""
        for _ in range(n):
            self.time_ns += PERIOD_NS
            self._service.clock.ns = self.time_ns
            found = [
                self._result(b, (ln_change, ck_change), quality, other)
                for b in ("UJB", "LJB", "TJB")
            ]
            seen, news = self._service.films.take("U1", found)
            for one in seen:
                self._service.live.set_assessment(one)
            self._service.store.append([], [], [], news)

    def _result(
        self, bearing: str, change: tuple[float, float], quality: Quality, other: dict[str, float]
    ) -> Assessment:
        numbers = {name: float(getattr(self._lived, name)[-1]) for name in CONDITION_COLUMNS}
        k = {}
        for direction in DIRECTIONS:
            axes = direction * 2
            for name, ln, key, share in (
                (f"k_{direction}", change[0], f"dynamic_k_{axes}_n_per_m", 0.01),
                (f"ck_{direction}", change[1], f"dynamic_ck_{axes}_s", 0.004),
            ):
                value = None if quality.level else math.exp(self._learned(name) + ln)
                k[key] = Reading(value, quality, None if value is None else share * value)
        numbers["attitude_angle_deg"] = numbers.pop("attitude_deg")
        numbers.pop("u_eccentricity")
        return self._assessment(self.time_ns, bearing=bearing, **k, **{**numbers, **other})

    def _learned(self, name: str) -> float:
        """What was learned of the upper bearing under that condition, in ln."""
        learned = self._service.films.baseline("U1", "UJB").of(name)
        newest = self._lived.conditions.rows(np.array([len(self._lived) - 1]))
        return float(learned.surface.at(newest)[0])


@pytest.fixture
async def machine(service, lived, assessment) -> Machine:
    """That machine, running on."""
    await asyncio.sleep(0)
    return Machine(service, lived, assessment)
