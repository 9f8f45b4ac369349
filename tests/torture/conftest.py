"""How long the torture takes, and by which seed."""

from collections.abc import Callable

import pytest

N_SHORT = 25
"""By how much the short torture of every test run is less than the whole one."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of ``make torture``; a run of all tests knows none of them."""
    parser.addoption("--torture", action="store_true", help="as long as the issue of it asks for")
    parser.addoption("--torture-seed", type=int, default=1, help="of everything that is random")


@pytest.fixture(scope="session")
def torture_seed(pytestconfig: pytest.Config) -> int:
    """Seed of everything that is random."""
    return int(pytestconfig.getoption("--torture-seed", 1))


@pytest.fixture(scope="session")
def times(pytestconfig: pytest.Config) -> Callable[[int], int]:
    """Number of repetitions, of the number that the whole torture takes."""
    whole = bool(pytestconfig.getoption("--torture", False))
    return lambda number: number if whole else max(1, number // N_SHORT)


@pytest.fixture(scope="session")
def is_whole(pytestconfig: pytest.Config) -> bool:
    """Whether this is the whole torture."""
    return bool(pytestconfig.getoption("--torture", False))
