"""The demonstration begins with a year that is simulated, judged, and marked as such."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest

from core.baseline.history import StiffnessHistory
from core.change.decision import JUDGED, Verdict
from core.machine.unit import Estimator
from core.units import NS_PER_S
from service.cli.offline.demo_history import fill, without_past
from service.measuring.simulated_sources import simulated_history
from service.settings.loading import load_plant_file
from service.settings.plant import PlantFile
from service.store.baselines import versions_after
from service.store.film_readings import FilmQuery
from service.store.port import TrendQuery
from service.store.sqlite import SqliteStore

NOW_NS = 1_794_657_615 * NS_PER_S
YEARS = 0.3
K = "stiffness_xx_n_per_m"


@pytest.fixture(scope="module")
def plant() -> PlantFile:
    return load_plant_file(Path(__file__).parents[3] / "deploy" / "demo-life.toml")


@pytest.fixture(scope="module")
def pasts(plant: PlantFile) -> Mapping[str, Mapping[str, StiffnessHistory]]:
    return {"U1": simulated_history(plant.unit[0], NOW_NS, YEARS)}


@pytest.fixture(scope="module")
def store(
    tmp_path_factory: pytest.TempPathFactory,
    plant: PlantFile,
    pasts: Mapping[str, Mapping[str, StiffnessHistory]],
) -> Iterator[SqliteStore]:
    opened = SqliteStore(tmp_path_factory.mktemp("demo") / "padwatch.sqlite3")
    assert [unit.id for unit in without_past(opened.films, plant)] == ["U1", "U2"]
    fill(opened.films, plant, pasts, NOW_NS)
    yield opened
    opened.close()


def test_the_past_is_there_marked_and_judged(
    store: SqliteStore, pasts: Mapping[str, Mapping[str, StiffnessHistory]]
) -> None:
    for bearing, past in pasts["U1"].items():
        found = store.films.history(FilmQuery("U1", bearing, Estimator.DYNAMIC))
        np.testing.assert_array_equal(found.history.ln_k, past.ln_k)
        assert found.is_simulated.all()
        assert store.films.past_end_ns("U1", bearing) == past.time_ns[-1]
        settled = found.verdict[:, found.is_settled]
        assert np.mean(np.isin(settled, [int(v) for v in JUDGED])) > 0.8
        assert set(np.unique(found.verdict[:, ~found.is_settled])) <= {Verdict.TRANSIENT}
        assert np.nanstd(found.deviation) < 0.05
    assert store.films.past_end_ns("U2", "UJB") is None


def test_trends_show_the_past(
    store: SqliteStore, pasts: Mapping[str, Mapping[str, StiffnessHistory]]
) -> None:
    past = pasts["U1"]["UJB"]
    asked = TrendQuery("U1", "UJB", (K, "power_mw"), 0, NOW_NS, 10**6, 10**12)
    trend = store.trend(asked)
    shown = np.array([np.nan if k is None else k for k in trend.series[K].mean])
    there = np.isin(np.array(trend.time_ns), past.time_ns)  # between them, holes
    np.testing.assert_array_equal(shown[there], np.exp(past.ln_k[0]))


def test_a_past_is_given_once_with_a_baseline_that_says_where_it_comes_from(
    store: SqliteStore, plant: PlantFile, pasts: Mapping[str, Mapping[str, StiffnessHistory]]
) -> None:
    fill(store.films, plant, pasts, NOW_NS + 10**15)
    assert [unit.id for unit in without_past(store.films, plant)] == ["U2"]
    assert versions_after(store.films.steps("U1", "LJB")).in_force == 1
    [entry] = store.films.baselines("U1", "LJB")
    assert (entry.author, entry.event) == ("padwatch demo", "learned from a simulated year")
    assert set(store.films.responses()) == {"U1"}
