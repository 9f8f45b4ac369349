"""How long the torture takes, by which seed, and what is said at its end."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from harness import summary
from harness.ledger_daq import LedgerDaq, ledger_daq
from harness.ledger_plant import LedgerPlant
from harness.summary import Torture
from rigs.memory_folder import memory_folder

SHORT_SOAK_S = 3.0
"""A soak of every test run; nothing can be said of what grows, but the accounts must close."""

TABLE = Path(__file__).parents[2] / "build" / "torture.txt"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of ``make torture``; a run of all tests knows none of them."""
    parser.addoption("--torture", action="store_true", help="the whole of it, for hours")
    parser.addoption("--torture-seed", type=int, default=1, help="of everything that is random")
    parser.addoption("--soak-minutes", type=float, default=20.0, help="of the whole torture's soak")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say what the whole torture has found, and write it down."""
    config = terminalreporter.config
    if not config.getoption("--torture", False):
        return
    found = summary.lines(terminalreporter.stats, int(config.getoption("--torture-seed")))
    terminalreporter.section("torture")
    for line in found:
        terminalreporter.write_line(line)
    summary.write(TABLE, found)


@pytest.fixture(scope="session")
def torture_seed(pytestconfig: pytest.Config) -> int:
    """Seed of everything that is random."""
    return int(pytestconfig.getoption("--torture-seed", 1))


@pytest.fixture(scope="session")
def soak_s(pytestconfig: pytest.Config, is_whole: bool) -> float:
    """How long the soak lasts."""
    return 60.0 * float(pytestconfig.getoption("--soak-minutes")) if is_whole else SHORT_SOAK_S


@pytest.fixture(scope="session")
def is_whole(pytestconfig: pytest.Config) -> bool:
    """Whether this is the whole torture."""
    return bool(pytestconfig.getoption("--torture", False))


@pytest.fixture
def tmp_path(tmp_path: Path, is_whole: bool) -> Iterator[Path]:
    """Folder of a test: in memory where the whole torture is not asked for, which syncs quickly."""
    if is_whole:
        yield tmp_path
        return
    with memory_folder() as folder:
        yield folder


@pytest.fixture
def plant(torture_seed: int) -> LedgerPlant:
    """One unit with twelve channels at 600 Hz."""
    return LedgerPlant(seed=torture_seed, n_units=1, load=1.0)


@pytest.fixture
def daq(plant: LedgerPlant, tmp_path: Path) -> Iterator[LedgerDaq]:
    """A DAQ of the test's plant; it goes on offering samples whatever happens to the service."""
    with ledger_daq(plant, tmp_path) as running:
        yield running


@pytest.fixture
def torture(torture_seed, is_whole, record_property) -> Torture:
    """How much is done, and where figures go."""
    return Torture(torture_seed, is_whole, lambda row: record_property(summary.FIGURE, row))
