"""`padwatch demo`: the past that it gives its plant, and what it starts."""

from contextlib import closing, nullcontext
from functools import partial
from pathlib import Path

import pytest
from rigs.command_line import padwatch

from core.machine.unit import Estimator
from service.cli import run as demo
from service.cli.daq import RunningDaq
from service.measuring.simulated_sources import simulated_history
from service.settings.plant import PlantFile
from service.store.baselines import versions_after
from service.store.film_readings import FilmQuery
from service.store.sqlite import SqliteStore

PORTS = {"U1": 5021, "U2": 5022}
PAST_YEARS = 0.2
"""Of which a baseline is learned."""

Begun = list[tuple[PlantFile, int]]


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> Begun:
    """Plants that would be run, each with its port, beside a DAQ that is not there."""
    found: Begun = []
    daq = RunningDaq({unit: {"port": port} for unit, port in PORTS.items()}, {})
    monkeypatch.setattr(demo, "daq_process", lambda _: nullcontext(daq))

    def run(plant: PlantFile, port: int, *, is_demo: bool) -> None:
        assert is_demo
        found.append((plant, port))

    monkeypatch.setattr(demo, "run_plant", run)
    past = partial(simulated_history, years=PAST_YEARS)
    monkeypatch.setattr(demo, "simulated_history", past)
    return found


def test_the_demo_begins_with_a_past_that_it_is_given_once(begun: Begun, tmp_path: Path) -> None:
    first, again = (padwatch("demo", "--port", 0, "--data-folder", tmp_path) for _ in range(2))

    assert (first.exit_code, again.exit_code) == (0, 0), first.output
    assert "simulating the year before this start" in first.stdout
    assert "simulating" not in again.stdout
    for plant, port in begun:
        assert {unit.id: unit.source.port for unit in plant.unit} == PORTS
        assert port == 0
    with closing(SqliteStore(tmp_path / "padwatch.sqlite3")) as store:
        for unit in PORTS:
            film = store.films.history(FilmQuery(unit, "LJB", Estimator.DYNAMIC))
            assert film.is_simulated.all()
            assert versions_after(store.films.steps(unit, "LJB")).in_force == 1


def test_a_plain_demo_has_no_past(begun: Begun, tmp_path: Path) -> None:
    done = padwatch("demo", "--plain", "--port", 0, "--data-folder", tmp_path)

    assert (done.exit_code, len(begun)) == (0, 1), done.output
    assert begun[0][0].service.data_folder == str(tmp_path)
    assert not list(tmp_path.iterdir())
