"""What the service's tests share: plant files as text, and a way to change one line of them."""

import os
from collections.abc import Callable, Iterator
from contextlib import closing
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from harness.places import Place, PostgresPlace, SqlitePlace
from harness.postgres_server import PostgresServer, shared_server, why_not
from rigs.database_copy import copy_database
from rigs.memory_folder import memory_folder

from core.baseline.history import ReadingOutcome, StiffnessHistory
from core.change.backtest import operation_history
from core.change.decision import INITIAL_DECISION, Verdict
from core.change.film_judge import FilmNews, unjudged
from core.change.film_reading import FilmReading, FilmValue
from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingLimits, OperatingState
from core.machine.unit import Estimator
from core.quality import Reason
from service.settings.plant import PlantFile, load_plant_file
from service.settings.storage import Origin
from service.settings.toml_file import TomlFileError
from service.settings.units import UnitSettings
from service.store.access.tables import AccessStore
from service.store.postgres.connection import PostgresAddress
from service.store.postgres.database import PostgresDatabase
from service.store.sqlite import SqliteStore
from service.store.sqlite.store import open_access_file

DEPLOY = Path(__file__).parents[2] / "deploy"

OPERATING = OperatingLimits(92.3, 330.0, warm_up_s=3600.0)
TEMPLATE = "padwatch_template"
NUMBERS = count()
PLACES = ("sqlite", "postgres")


@pytest.fixture
def deploy() -> Path:
    """Folder of the plant files that come with padwatch."""
    return DEPLOY


@pytest.fixture
def plant_text() -> str:
    """The demonstration plant: two units, each with channels, bearings and simulation."""
    return (DEPLOY / "demo.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def plant() -> PlantFile:
    """The same, loaded: U1 at part load, U2 at full load."""
    return load_plant_file(DEPLOY / "demo.toml")


@pytest.fixture(scope="session")
def unit(plant: PlantFile) -> UnitSettings:
    """Unit U1 of it."""
    return plant.unit[0]


@pytest.fixture
def plant_path(plant_text: str, tmp_path: Path) -> Path:
    """A file of that plant, with its data in a folder that is not there yet."""
    path, old = tmp_path / "plant.toml", 'data_folder = "var/demo"'
    assert old in plant_text
    new = f'data_folder = "{tmp_path / "data"}"'
    path.write_text(plant_text.replace(old, new), encoding="utf-8")
    return path


@pytest.fixture
def changed(plant_text: str) -> Callable[[str, str], tuple[str, int]]:
    """Changes the first occurrence of a text in that file; also tells on which line that is."""

    def change(old: str, new: str) -> tuple[str, int]:
        before, found, after = plant_text.partition(old)
        assert found, f"the file has no {old!r}"
        return before + new + after, before.count("\n") + 1

    return change


@pytest.fixture
def mistakes(tmp_path: Path) -> Callable[[str | bytes], list[str]]:
    """Loads a plant file that must be refused; gives the message's lines after ``file:``."""

    def refused(text: str | bytes) -> list[str]:
        path = tmp_path / "plant.toml"
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        with pytest.raises(TomlFileError) as refusal:
            load_plant_file(path)
        lines = str(refusal.value).split("\n")
        assert all(line.startswith(f"{path}:") for line in lines)
        return [line.removeprefix(f"{path}:") for line in lines]

    return refused


@pytest.fixture(scope="session")
def film_news() -> Callable[..., list[FilmNews]]:
    """Makes news, without any verdict, of the readings of a history under operating limits."""

    def tell(
        history: StiffnessHistory, limits: OperatingLimits = OPERATING, bearing: str = "UJB"
    ) -> list[FilmNews]:
        found = operation_history(history.time_ns, history.speed_rpm, history.power_mw, limits)
        said = unjudged(Verdict.NO_BASELINE)
        return [
            FilmNews(
                reading_at(history, i, bearing, int(found.state[i]), bool(found.is_settled[i])),
                said,
                (INITIAL_DECISION,) * len(said),
            )
            for i in range(len(history))
        ]

    return tell


def reading_at(
    history: StiffnessHistory, i: int, bearing: str, state: int, is_settled: bool
) -> FilmReading:
    x, y = (
        FilmValue(
            float(history.ln_k[row, i]),
            float(history.u_random[row, i]),
            float(history.shaft_um_pk[row, i]),
            float(history.bearing_um_pk[row, i]),
            ReadingOutcome.MEASURED
            if np.isfinite(history.ln_k[row, i])
            else ReadingOutcome.BAD_QUALITY,
            Reason.OK if np.isfinite(history.ln_k[row, i]) else Reason.LOW_COVERAGE,
            float(history.ln_ck[row, i]),
            float(history.u_ck[row, i]),
        )
        for row in range(2)
    )
    numbers = (
        *("speed_rpm", "power_mw", "eccentricity_ratio", "u_eccentricity"),
        *("attitude_deg", "oil_temperature_c"),
    )
    return FilmReading(
        "U1",
        bearing,
        Estimator.DYNAMIC,
        int(history.time_ns[i]),
        BearingCondition(OperatingState(state), is_settled, None),
        **{name: float(getattr(history, name)[i]) for name in numbers},
        values=(x, y),
    )


@pytest.fixture(scope="session")
def worker() -> str:
    """Name of this process among those that run the tests."""
    return os.environ.get("PYTEST_XDIST_WORKER", "main")


@pytest.fixture(scope="session")
def postgres_server(tmp_path_factory, worker) -> Iterator[PostgresServer]:
    """A server that all tests of a run share, with a database that is up to date."""
    why = why_not()
    if why is not None:
        pytest.skip(why)
    own = tmp_path_factory.getbasetemp()
    with shared_server(own if worker == "main" else own.parent, make_template) as server:
        yield server


def make_template(server: PostgresServer) -> None:
    """Make the database that fresh ones are copied from."""
    server.create(TEMPLATE)
    PostgresDatabase(PostgresAddress(server.conninfo(TEMPLATE)), Origin.LIVE).close()


@pytest.fixture
def postgres_place(postgres_server, tmp_path, worker) -> Iterator[PostgresPlace]:
    """A fresh database."""
    name = f"padwatch_{worker}_{next(NUMBERS)}"
    postgres_server.create(name, TEMPLATE)
    yield PostgresPlace(postgres_server, name, tmp_path / "data")
    postgres_server.drop(name)


@pytest.fixture(scope="session")
def database_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty SQLite database, for copies."""
    path = tmp_path_factory.mktemp("database") / "padwatch.sqlite3"
    SqliteStore(path).close()
    return path


@pytest.fixture
def store(database_file: Path, tmp_path: Path) -> Iterator[SqliteStore]:
    """An open, empty store, whose file is ``padwatch.sqlite3`` in the folder of the test."""
    with closing(SqliteStore(copy_database(database_file, tmp_path))) as opened:
        yield opened


@pytest.fixture(scope="session")
def access_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty SQLite file of accounts, for copies."""
    path = tmp_path_factory.mktemp("access") / "access.sqlite3"
    open_access_file(path).close()
    return path


@pytest.fixture
def access_store(access_file: Path, tmp_path: Path) -> Iterator[AccessStore]:
    """Open accounts without any, whose file is ``access.sqlite3`` in the folder of the test."""
    with closing(open_access_file(copy_database(access_file, tmp_path))) as opened:
        yield opened


@pytest.fixture
def folder_in_memory() -> Iterator[Path]:
    """A folder in which a sync costs nothing, if the machine has one."""
    with memory_folder() as folder:
        yield folder


@pytest.fixture
def sqlite_place(database_file: Path, tmp_path: Path) -> SqlitePlace:
    """A fresh file."""
    return SqlitePlace(copy_database(database_file, tmp_path / "data"))


@pytest.fixture
def store_place(request: pytest.FixtureRequest) -> Place:
    """Where the store is: tests that ask for it, or for a store in it, go over both databases."""
    found: Place = request.getfixturevalue(f"{request.param}_place")
    return found


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Both databases, except for tests that ask for the ``path`` of a file."""
    if "store_place" in metafunc.fixturenames:
        is_of_a_file = "path" in metafunc.fixturenames
        metafunc.parametrize("store_place", PLACES[:1] if is_of_a_file else PLACES, indirect=True)
